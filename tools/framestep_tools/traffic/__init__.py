"""What goes over the line between a host and a controller: recorded, shown, compared, replayed."""

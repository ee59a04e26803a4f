"""Traffic between a host and a controller: recorded, shown, compared, replayed."""

"""Motors: their settings, and the way from a request or a played move to segments in their
queues."""

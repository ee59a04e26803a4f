"""Motors: their settings, and how requests and played moves become segments in their queues."""

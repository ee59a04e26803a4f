"""The client: frames, requests and answers, and the ports to a board."""

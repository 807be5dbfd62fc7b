"""Runs on a backend: one request, a queue of them, and a server of the queue."""

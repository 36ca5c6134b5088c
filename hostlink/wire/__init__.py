"""The definition of what goes over the wire."""

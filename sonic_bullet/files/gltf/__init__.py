"""glTF 2.0 as a container: a JSON tree and numbers in buffers, read and written. What they mean, their users know."""

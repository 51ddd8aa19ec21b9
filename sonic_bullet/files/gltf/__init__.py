"""glTF 2.0 as a container: a JSON tree and numbers in buffers, read and written without their meaning."""

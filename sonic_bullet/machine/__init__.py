"""What the machine under us asks for: private folders, locked files that are not finished, compiled code, progress."""

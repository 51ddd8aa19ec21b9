"""Values -> one HTML page that opens offline."""

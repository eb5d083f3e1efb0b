"""Images -> score rows."""

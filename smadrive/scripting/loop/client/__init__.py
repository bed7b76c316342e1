"""The script's end of the link to its loop process."""

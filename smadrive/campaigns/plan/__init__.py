"""The campaign file, and the list of runs that it describes. Nothing is computed or sent here."""

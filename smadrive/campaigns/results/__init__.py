"""The results of a campaign: the table with its units, summaries, sensitivity, plots and page."""

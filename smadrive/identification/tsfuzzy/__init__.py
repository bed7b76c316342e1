"""The fit of a T-S fuzzy Duhem model: problem, derivatives, prior, monotone slopes."""

"""Quality of a fit: residuals, hold-out, leave-one-out, caveats."""

"""Quality of a fit: residuals, uncertainty, leave-one-out, caveats."""

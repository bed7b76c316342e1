"""Controllers: temperature, displacement tracking, and their feedback."""

"""From a wanted displacement to a heater current: pure `update(..., dt)`, no transport, no clock of its own."""

/* The values of the hardware: those of the range (make RANGE=...), and those that all ranges share. */
#ifndef RANGE_H
#define RANGE_H

#include RANGE_FILE

#ifndef TEMPERATURE_MAX
#define TEMPERATURE_MAX 1600u /* the board's own limit, 0.1 degC */
#endif

#ifndef WATCHDOG_MS
#define WATCHDOG_MS 500u /* the default of the register watchdog_s */
#endif

/* Displacement at 1.1 V of the analogue input, 0.0001 mm: a sensor with 0.1 V per mm behind a divider by 5. */
#define DISPLACEMENT_FULL_SCALE 550912L

#endif

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

/* Displacement of one step of the ADC, 0.0001 mm: 1.1 V at the analogue input are 22.5 mm. docs/board.md says how to
 * make the divider; the rig file of the host corrects offset and scale. */
#define DISPLACEMENT_STEP 220L

#endif

/* The chips on the I2C bus: the INA226 at both ends of the wire, and the MCP4725 of the current source. */
#ifndef CHIPS_H
#define CHIPS_H

#include <stdbool.h>
#include <stdint.h>

/* The current (0.1 mA) and the voltage across the wire (mV); false when a meter does not answer. */
bool meters_read(uint16_t *current, uint16_t *voltage);

/* Right chips at both addresses. */
bool meters_test(void);

/* Sets the output for `current` (0.1 mA); false when the DAC does not answer. */
bool source_set(uint16_t current);

/* The DAC answers, and holds the code that was set last. */
bool source_test(void);

/* Makes 0 the output at power-up, once in the life of the DAC. */
void source_begin(void);

#endif

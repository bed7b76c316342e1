/* The EEPROM: calibration constants at address 0, serial number at address 16. */
#ifndef STORAGE_H
#define STORAGE_H

#include <stdint.h>

#include "../core/calibration.h"

void storage_read_calibration(struct calibration *calibration);

/* The serial number, or 0 when none was stored. */
uint32_t storage_serial_number(void);

/* Begins to store `calibration`. storage_step stores its next byte when the EEPROM is ready; call it again and again. */
void storage_write_calibration(const struct calibration *calibration);
void storage_step(void);

#endif

/* The I2C bus at 400 kHz, without interrupts. No call lasts longer than 1.5 ms, whatever the bus does. */
#ifndef I2C_H
#define I2C_H

#include <stdbool.h>
#include <stdint.h>

/* Each returns false when a chip does not acknowledge or the bus is stuck. The next call then frees the bus. */
bool i2c_write(uint8_t address, const uint8_t *bytes, uint8_t count);
bool i2c_read(uint8_t address, uint8_t *bytes, uint8_t count);
bool i2c_read_register(uint8_t address, uint8_t pointer, uint16_t *value);

#endif

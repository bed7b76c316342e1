/* The MCP4725 DAC. Facts from its data sheet (Microchip DS22039), "Theory of Operation".
 *
 *   fast write       0 0 PD1 PD0 D11..D8, D7..D0                     the output changes after the second byte
 *   write            0 1 0 x x PD1 PD0 x, D11..D4, D3..D0 x x x x    011 also writes the EEPROM
 *   read             RDY POR x x x PD1 PD0 x, D11..D4, D3..D0 x x x x, x PD1 PD0 x D11..D8 and D7..D0 of the EEPROM
 *
 * At power-up the output is the content of the EEPROM, which is half of the scale as the chip leaves the factory. With
 * a power-down bit the output is pulled to ground.
 */
#include "parts.h"

#define ADDRESS 0x60
#define FACTORY_CODE 0x800

static void start(struct twi_slave *slave, bool reading) {
    (void)reading;
    ((struct dac *)slave)->count = 0;
}

static bool write_byte(struct twi_slave *slave, uint8_t byte) {
    struct dac *dac = (struct dac *)slave;
    bool fast = !(dac->first & 0xC0);
    if (dac->count == 0) {
        dac->first = byte;
        dac->count = 1;
    } else if (fast) {
        dac->code = (uint16_t)((dac->first & 0x3F) << 8 | byte);
        dac->count = 0;
    } else if (dac->count == 1) {
        dac->second = byte;
        dac->count = 2;
    } else {
        dac->code = (uint16_t)((dac->first & 0x06) << 11 | dac->second << 4 | byte >> 4);
        if ((dac->first & 0xE0) == 0x60) {
            dac->stored = dac->code;
        }
        dac->count = 0;
    }
    return true;
}

static uint8_t read_byte(struct twi_slave *slave) {
    struct dac *dac = (struct dac *)slave;
    switch (dac->count++ % 5) {
        case 0: return (uint8_t)(0xC0 | (dac->code >> 11 & 0x06));
        case 1: return (uint8_t)(dac->code >> 4);
        case 2: return (uint8_t)(dac->code << 4);
        case 3: return (uint8_t)((dac->stored >> 12 & 3) << 5 | (dac->stored >> 8 & 0x0F));
        default: return (uint8_t)dac->stored;
    }
}

void dac_power_up(struct dac *dac) {
    uint16_t stored = dac->slave.address ? dac->stored : FACTORY_CODE;
    *dac = (struct dac){
        .slave = {.address = ADDRESS, .start = start, .write = write_byte, .read = read_byte},
        .code = stored,
        .stored = stored,
    };
}

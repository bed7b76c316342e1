/* The INA226 current and voltage meter. Facts from its data sheet (TI SBOS547B), "Registers".
 *
 *   00h configuration (4127h at power-up, bit 15 resets, bits 2..0 mode)    01h shunt voltage, 2.5 uV, signed
 *   02h bus voltage, 1.25 mV                                                03h power, 25 times the LSB of the current
 *   04h current = shunt voltage * calibration / 2048                        05h calibration
 *   06h mask and enable, 07h alert limit                                    FEh 5449h ("TI"), FFh 2260h
 *
 * A write sends the pointer and two bytes; a read sends the two bytes of the register that the pointer names, the high
 * byte first. A conversion takes 1.1 ms, which is short against the 10 ms between two reads, so values are the present
 * ones.
 */
#include <math.h>
#include <stdlib.h>

#include "parts.h"

#define SHUNT_LSB_V 2.5e-6
#define BUS_LSB_V 1.25e-3
#define CONFIG_AT_POWER_UP 0x4127u

static int16_t clamped(double counts, double least) { return (int16_t)lround(fmax(least, fmin(counts, 32767.0))); }

static uint16_t value_of(const struct meter *meter, uint8_t pointer) {
    bool off = !(meter->config & 3);
    int16_t shunt = off ? 0 : clamped(*meter->shunt_v / SHUNT_LSB_V, -32768.0);
    int16_t bus = off ? 0 : clamped(*meter->bus_v / BUS_LSB_V, 0.0);
    int32_t current = (int32_t)shunt * meter->calibration / 2048;
    switch (pointer) {
        case 0x00: return meter->config;
        case 0x01: return (uint16_t)shunt;
        case 0x02: return (uint16_t)bus;
        case 0x03: return (uint16_t)(labs(current) * bus / 20000);
        case 0x04: return (uint16_t)current;
        case 0x05: return meter->calibration;
        case 0x06: return meter->mask;
        case 0x07: return meter->limit;
        case 0xFE: return 0x5449;
        case 0xFF: return 0x2260;
        default: return 0;
    }
}

static void store(struct meter *meter, uint16_t value) {
    switch (meter->pointer) {
        case 0x00: meter->config = value & 0x8000 ? CONFIG_AT_POWER_UP : value; break;
        case 0x05: meter->calibration = value & 0x7FFF; break;
        case 0x06: meter->mask = value; break;
        case 0x07: meter->limit = value; break;
        default: break;
    }
}

static void start(struct twi_slave *slave, bool reading) {
    (void)reading;
    ((struct meter *)slave)->count = 0;
}

static bool write_byte(struct twi_slave *slave, uint8_t byte) {
    struct meter *meter = (struct meter *)slave;
    switch (meter->count++) {
        case 0: meter->pointer = byte; break;
        case 1: meter->high = byte; break;
        case 2: store(meter, (uint16_t)(meter->high << 8 | byte)); break;
        default: break;
    }
    return true;
}

static uint8_t read_byte(struct twi_slave *slave) {
    struct meter *meter = (struct meter *)slave;
    uint16_t value = value_of(meter, meter->pointer);
    return (uint8_t)(meter->count++ % 2 ? value : value >> 8);
}

void meter_power_up(struct meter *meter, uint8_t address, const double *shunt_v, const double *bus_v) {
    *meter = (struct meter){
        .slave = {.address = address, .start = start, .write = write_byte, .read = read_byte},
        .shunt_v = shunt_v,
        .bus_v = bus_v,
        .config = CONFIG_AT_POWER_UP,
    };
}

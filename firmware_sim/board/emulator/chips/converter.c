/* The MAX31856 thermocouple converter. Facts from its data sheet (Maxim 19-7534), "Internal Registers".
 *
 *   00h CR0   bit 7 CMODE: convert continuously; bits 5..4 OCFAULT; bit 0: 50 Hz instead of 60 Hz
 *   01h CR1   bits 6..4 AVGSEL; bits 3..0 type of the thermocouple, 3 is K (the value at power-up)
 *   02h MASK .. 09h CJTO                thresholds, kept and not used here
 *   0Ah CJTH, 0Bh CJTL                  cold junction, 14 bits, 2^-6 degC, left-aligned in 16 bits
 *   0Ch LTCBH, 0Dh LTCBM, 0Eh LTCBL     thermocouple, 19 bits, 2^-7 degC, left-aligned in 24 bits
 *   0Fh SR    bit 6 TC range, bit 1 OVUV, bit 0 OPEN
 *
 * A write has bit 7 of the address set; the address counts up. DRDY goes low at the end of a conversion, and high when
 * the temperature is read. In continuous mode a conversion takes 82 ms with the 60 Hz filter and 98 ms with the 50 Hz
 * filter, the first after a change of the mode longer. An open circuit is looked for once every 16 conversions. While an
 * input is above or below the supply (OVUV), the chip does not convert.
 *
 * The board has a resistor from T+ to the supply. With an open thermocouple it drives the input far above the range, so
 * that the next conversion reads 1372 degC (the end of type K) with the bit TC range.
 */
#include <math.h>
#include <string.h>

#include "parts.h"

enum { CR0, CR1, MASK, CJHF, CJLF, LTHFTH, LTHFTL, LTLFTH, LTLFTL, CJTO, CJTH, CJTL, LTCBH, LTCBM, LTCBL, SR };
enum { CMODE = 0x80, OCFAULT = 0x30, HZ50 = 0x01, WRITE = 0x80, TC_RANGE = 0x40, OVUV = 0x02, OPEN = 0x01 };

#define MS (EMULATOR_HZ / 1000)
#define TYPE_K_MAX_C 1372.0
#define OPEN_TEST_INTERVAL 16

void converter_power_up(struct converter *converter) {
    static const uint8_t defaults[16] = {0x00, 0x03, 0xFF, 0x7F, 0xC0, 0x7F, 0xFF, 0x80};
    memset(converter, 0, sizeof *converter);
    memcpy(converter->registers, defaults, sizeof defaults);
}

static uint64_t conversion_cycles(const struct converter *converter) {
    bool first = converter->conversions == 0;
    if (converter->registers[CR0] & HZ50) {
        return (first ? 169u : 98u) * MS;
    }
    return (first ? 143u : 82u) * MS;
}

static void store_temperature(struct converter *converter, double temperature_c) {
    uint32_t counts = (uint32_t)(int32_t)lround(temperature_c * 128.0) << 5;
    converter->registers[LTCBH] = (uint8_t)(counts >> 16);
    converter->registers[LTCBM] = (uint8_t)(counts >> 8);
    converter->registers[LTCBL] = (uint8_t)counts;
}

static void store_cold_junction(struct converter *converter, double temperature_c) {
    uint16_t counts = (uint16_t)((int16_t)lround(temperature_c * 64.0) * 4);
    converter->registers[CJTH] = (uint8_t)(counts >> 8);
    converter->registers[CJTL] = (uint8_t)counts;
}

static void convert(struct emulator *emulator) {
    struct converter *converter = &emulator->converter;
    bool open = emulator->world.converter == CONVERTER_OPEN;
    uint8_t status = converter->registers[SR] & OPEN;
    bool tested = converter->registers[CR0] & OCFAULT && converter->conversions % OPEN_TEST_INTERVAL == 0;
    if (tested) {
        status = open ? OPEN : 0;
    }
    store_temperature(converter, open ? TYPE_K_MAX_C : emulator->world.temperature_c);
    store_cold_junction(converter, emulator->world.cold_junction_c);
    converter->registers[SR] = status | (open ? TC_RANGE : 0);
    converter->conversions++;
    converter->ready = true;
}

/* Conversions that have ended since the chip was last looked at. */
static void catch_up(struct emulator *emulator) {
    struct converter *converter = &emulator->converter;
    uint64_t now = emulator->avr->cycle;
    bool shorted = emulator->world.converter == CONVERTER_SHORT;
    bool idle = !(converter->registers[CR0] & CMODE) || emulator->world.converter == CONVERTER_STOPPED;
    if (shorted) {
        converter->registers[SR] |= OVUV;
    } else {
        converter->registers[SR] &= (uint8_t)~OVUV;
    }
    if (idle || shorted) {
        converter->due = now + conversion_cycles(converter);
        return;
    }
    if (converter->due <= now && emulator->world.converter == CONVERTER_RESETTING) {
        converter_power_up(converter);
        return;
    }
    while (converter->due <= now) {
        convert(emulator);
        converter->due += conversion_cycles(converter);
    }
}

bool converter_is_ready(struct emulator *emulator) {
    catch_up(emulator);
    return emulator->converter.ready && emulator->world.converter != CONVERTER_ABSENT;
}

void converter_begin(struct converter *converter) { converter->addressed = false; }

static void write_register(struct emulator *emulator, uint8_t address, uint8_t value) {
    struct converter *converter = &emulator->converter;
    if (address > CJTL) {
        return;
    }
    converter->registers[address] = value;
    if (address == CR0) {
        converter->conversions = 0;
        converter->due = emulator->avr->cycle + conversion_cycles(converter);
    }
}

uint8_t converter_exchange(struct emulator *emulator, uint8_t byte) {
    struct converter *converter = &emulator->converter;
    uint8_t address = converter->address & 0x0F;
    uint8_t answer = 0xFF;
    catch_up(emulator);
    if (!converter->addressed) {
        converter->addressed = true;
        converter->address = byte;
        return answer;
    }
    if (converter->address & WRITE) {
        write_register(emulator, address, byte);
    } else {
        answer = converter->registers[address];
    }
    if (address >= LTCBH && address <= LTCBL) {
        converter->ready = false;
    }
    converter->address = (converter->address & WRITE) | ((address + 1) & 0x0F);
    return answer;
}

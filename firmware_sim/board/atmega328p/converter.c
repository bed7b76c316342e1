/* MAX31856: data sheet Maxim 19-7534, "Internal Registers".
 *
 *   00h CR0: bit 7 CMODE converts continuously, bits 5..4 = 01 look for an open circuit (leads below 5 kOhm), bit 0 50 Hz
 *   01h CR1: bits 6..4 = 000 one sample, bits 3..0 = 0011 type K
 *   0Ah..0Bh cold junction, 2^-6 degC left-aligned in 16 bits; 0Ch..0Eh thermocouple, 2^-7 degC left-aligned in 24 bits
 *   0Fh SR: bit 6 the thermocouple is out of range, bit 1 OVUV, bit 0 OPEN
 *
 * SPI mode 1, at most 5 MHz; 4 MHz here. DRDY is low from the end of a conversion until the temperature is read. The chip
 * looks for an open circuit only once in 16 conversions, so a resistor from T+ to 3.3 V drives an open input out of
 * range, and the next conversion shows it. While an input is above the supply or below ground, the chip does not
 * convert, so the status is read every time.
 */
#include "converter.h"

#include <avr/io.h>

#include "pins.h"

#ifdef MAINS_50_HZ
#define FILTER 0x01
#else
#define FILTER 0x00
#endif

enum { CR0 = 0x00, CJTH = 0x0A, SR = 0x0F, WRITE_CR0 = 0x80 };
enum { CR0_VALUE = 0x90 | FILTER, CR1_VALUE = 0x03 };
enum { OUT_OF_RANGE = 0x40, OVUV = 0x02, OPEN = 0x01 };

static uint8_t exchange(uint8_t byte) {
    SPDR = byte;
    while (!(SPSR & _BV(SPIF)))
        ; /* 32 cycles: the SPI waits for no other chip */
    return SPDR;
}

static void select(uint8_t address) {
    PORTB &= (uint8_t)~CONVERTER_SELECT;
    exchange(address);
}

static void deselect(void) { PORTB |= CONVERTER_SELECT; }

static void configure(void) {
    select(WRITE_CR0);
    exchange(CR0_VALUE);
    exchange(CR1_VALUE);
    deselect();
}

static bool is_configured(void) {
    select(CR0);
    uint8_t cr0 = exchange(0);
    uint8_t cr1 = exchange(0);
    deselect();
    return cr0 == CR0_VALUE && cr1 == CR1_VALUE;
}

static uint8_t read_status(void) {
    select(SR);
    uint8_t status = exchange(0);
    deselect();
    return status;
}

static void read_temperatures(struct converter_reading *reading) {
    uint8_t bytes[5];
    select(CJTH);
    for (uint8_t index = 0; index < sizeof bytes; index++) {
        bytes[index] = exchange(0);
    }
    deselect();
    int16_t cold = (int16_t)((uint16_t)bytes[0] << 8 | bytes[1]) >> 2;
    int32_t hot = (int32_t)((uint32_t)bytes[2] << 24 | (uint32_t)bytes[3] << 16 | (uint32_t)bytes[4] << 8) >> 13;
    hot = hot * 25 / 32;
    reading->cold_junction = (int16_t)((int32_t)cold * 25 / 16);
    reading->temperature = hot > INT16_MAX ? INT16_MAX : hot < -INT16_MAX ? -INT16_MAX : (int16_t)hot;
}

void converter_begin(void) {
    PORTB |= CONVERTER_SELECT;
    DDRB |= CONVERTER_SELECT | SPI_DATA_OUT | SPI_CLOCK;
    SPCR = _BV(SPE) | _BV(MSTR) | _BV(CPHA);
    configure();
}

enum converter_status converter_read(struct converter_reading *reading) {
    if (!is_configured()) {
        configure();
        return CONVERTER_SILENT;
    }
    uint8_t status = read_status();
    if (status & OVUV) {
        return CONVERTER_SHORT;
    }
    if (status & (OPEN | OUT_OF_RANGE)) {
        return CONVERTER_OPEN;
    }
    if (PIND & CONVERTER_READY) {
        return CONVERTER_SAME;
    }
    read_temperatures(reading);
    return CONVERTER_NEW;
}

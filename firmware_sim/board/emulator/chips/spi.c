/* The SPI unit of the ATmega328P as master: data sheet, chapter "Serial Peripheral Interface".
 *
 * A byte needs eight clocks of the divider that SPR1..0 and SPI2X select. The firmware polls SPIF; there is no
 * interrupt. MISO has a pull-up resistor, so without a chip all bits read as 1. The converter samples on the second
 * edge (CPHA = 1) and takes at most 5 MHz; in another mode it sees and sends nothing.
 */
#include "parts.h"

enum { SPE = 0x40, MSTR = 0x10, CPHA = 0x04, SPIF = 0x80, SPI2X = 0x01 };

#define CONVERTER_HZ 5000000u

static unsigned divider(const avr_t *avr) {
    static const unsigned dividers[] = {4, 16, 64, 128};
    unsigned slow = dividers[avr->data[SPCR] & 3];
    return avr->data[SPSR] & SPI2X ? slow / 2 : slow;
}

static bool is_understood(const struct emulator *emulator) {
    const avr_t *avr = emulator->avr;
    return emulator->spi.selected && emulator->world.converter != CONVERTER_ABSENT && avr->data[SPCR] & CPHA &&
           EMULATOR_HZ / divider(avr) <= CONVERTER_HZ;
}

static avr_cycle_count_t end_of_byte(avr_t *avr, avr_cycle_count_t when, void *param) {
    struct emulator *emulator = param;
    (void)when;
    emulator->spi.input = is_understood(emulator) ? converter_exchange(emulator, emulator->spi.output) : 0xFF;
    avr->data[SPSR] |= SPIF;
    return 0;
}

static void write_data(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct emulator *emulator = param;
    (void)address;
    if ((avr->data[SPCR] & (SPE | MSTR)) != (SPE | MSTR)) {
        return;
    }
    emulator->spi.output = value;
    avr->data[SPSR] &= (uint8_t)~SPIF;
    avr_cycle_timer_register(avr, 8 * divider(avr), end_of_byte, emulator);
}

static uint8_t read_data(avr_t *avr, avr_io_addr_t address, void *param) {
    struct emulator *emulator = param;
    avr->data[SPSR] &= (uint8_t)~SPIF;
    return avr->data[address] = emulator->spi.input;
}

static void write_status(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    (void)param;
    avr->data[address] = (avr->data[address] & SPIF) | (value & SPI2X);
}

void spi_select(struct emulator *emulator, bool selected) {
    if (selected && !emulator->spi.selected) {
        converter_begin(&emulator->converter);
    }
    emulator->spi.selected = selected;
}

void spi_attach(struct emulator *emulator) {
    hook_write(emulator, SPDR, write_data);
    hook_read(emulator, SPDR, read_data);
    hook_write(emulator, SPSR, write_status);
}

void spi_reset(struct emulator *emulator) {
    spi_select(emulator, false);
    avr_cycle_timer_cancel(emulator->avr, end_of_byte, emulator);
}

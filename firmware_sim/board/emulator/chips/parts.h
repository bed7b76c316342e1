/* The parts of an emulator: three units of the microcontroller, and the chips on its buses. */
#ifndef PARTS_H
#define PARTS_H

#include <simavr/sim_avr.h>
#include <simavr/sim_cycle_timers.h>
#include <simavr/sim_interrupts.h>
#include <simavr/sim_io.h>
#include <stdbool.h>

#include "emulator.h"

/* Addresses in the data space; data sheet of the ATmega328P, chapter "Register Summary". */
enum {
    DDRB = 0x24,
    PORTB = 0x25,
    PINC = 0x26,
    DDRC = 0x27,
    PIND = 0x29,
    DDRD = 0x2A,
    PORTD = 0x2B,
    SPCR = 0x4C,
    SPSR = 0x4D,
    SPDR = 0x4E,
    MCUSR = 0x54,
    TIMSK1 = 0x6F,
    TWBR = 0xB8,
    TWSR = 0xB9,
    TWDR = 0xBB,
    TWCR = 0xBC,
    UCSR0A = 0xC0,
    UCSR0B = 0xC1,
    UBRR0L = 0xC4,
    UBRR0H = 0xC5,
    UDR0 = 0xC6
};

enum { TIMER1_COMPA = 11, USART_RX = 18, USART_UDRE = 19 }; /* numbers of interrupt vectors */

#define UART_QUEUE 65536u
#define UART_OUTPUT 65536u

struct uart {
    avr_int_vector_t *received, *empty;
    uint8_t queue[UART_QUEUE]; /* bytes of the host, a ring */
    size_t first, queued;
    double due; /* when the byte on the line is complete */
    bool receiving, lost;
    uint8_t buffer[3]; /* two bytes, and a third in the shift register */
    uint8_t buffered, overrun;
    bool shifting, waiting, complete; /* the transmitter: shift register, data register, flag TXC0 */
    uint8_t shifted, next;
    struct emulator_byte output[UART_OUTPUT];
    size_t output_count;
};

/* A chip on the I2C bus. */
struct twi_slave {
    uint8_t address;
    bool absent;
    void (*start)(struct twi_slave *slave, bool reading);
    bool (*write)(struct twi_slave *slave, uint8_t byte); /* false: not acknowledged */
    uint8_t (*read)(struct twi_slave *slave);
};

#define TWI_SLAVES 3

enum twi_operation { TWI_NOTHING, TWI_START, TWI_BYTE, TWI_STOP };

struct twi {
    struct twi_slave *slaves[TWI_SLAVES];
    struct twi_slave *selected;
    enum twi_operation operation;
    bool started, addressing, reading;
    uint8_t status;
    uint8_t held; /* clock pulses until an interrupted slave releases SDA */
};

struct spi {
    bool selected;
    uint8_t output, input;
};

struct converter { /* MAX31856 */
    uint8_t registers[16];
    uint8_t address;
    bool addressed, ready;
    uint64_t due; /* end of the conversion */
    uint32_t conversions;
};

struct meter { /* INA226 */
    struct twi_slave slave;
    const double *shunt_v, *bus_v;
    uint16_t config, calibration, mask, limit;
    uint8_t pointer, count, high;
};

struct dac { /* MCP4725 */
    struct twi_slave slave;
    uint16_t code, stored; /* bits 12, 13: power-down */
    uint8_t first, second, count;
};

struct emulator {
    avr_io_t io; /* first: simavr gives this pointer to the reset function */
    avr_t *avr;
    avr_int_vector_t *safety; /* the compare match of timer 1 */
    struct emulator_world world;
    struct emulator_probes probes;
    struct uart uart;
    struct twi twi;
    struct spi spi;
    struct converter converter;
    struct meter top, bottom;
    struct dac dac;
    double shunt_v;
    uint64_t target;
    uint64_t matched_at, entered_at, disabled_since;
    uint32_t random;
    bool enabled, interrupts_used, crashed;
};

/* Replaces simavr's handlers of a register. */
static inline void hook_write(struct emulator *emulator, uint16_t address, avr_io_write_t write) {
    emulator->avr->io[AVR_DATA_TO_IO(address)].w.c = write;
    emulator->avr->io[AVR_DATA_TO_IO(address)].w.param = emulator;
}

static inline void hook_read(struct emulator *emulator, uint16_t address, avr_io_read_t read) {
    emulator->avr->io[AVR_DATA_TO_IO(address)].r.c = read;
    emulator->avr->io[AVR_DATA_TO_IO(address)].r.param = emulator;
}

/* NULL when the microcontroller has no interrupt with this number. */
static inline avr_int_vector_t *find_vector(avr_t *avr, uint8_t number) {
    for (int index = 0; index < avr->interrupts.vector_count; index++) {
        if (avr->interrupts.vector[index]->vector == number) {
            return avr->interrupts.vector[index];
        }
    }
    return NULL;
}

void uart_attach(struct emulator *emulator);
void uart_reset(struct emulator *emulator);

void twi_attach(struct emulator *emulator);
void twi_reset(struct emulator *emulator);
bool twi_data_is_low(const struct emulator *emulator);

void spi_attach(struct emulator *emulator);
void spi_reset(struct emulator *emulator);
void spi_select(struct emulator *emulator, bool selected);

void converter_power_up(struct converter *converter);
void converter_begin(struct converter *converter);
uint8_t converter_exchange(struct emulator *emulator, uint8_t byte);
bool converter_is_ready(struct emulator *emulator);

void meter_power_up(struct meter *meter, uint8_t address, const double *shunt_v, const double *bus_v);
void dac_power_up(struct dac *dac);

void pins_attach(struct emulator *emulator);
void pins_update(struct emulator *emulator);

void probes_attach(struct emulator *emulator);
void probes_reset(struct emulator *emulator);

/* After every instruction. */
static inline void probes_step(struct emulator *emulator) {
    const avr_t *avr = emulator->avr;
    if (avr->sreg[7]) {
        if (emulator->interrupts_used && emulator->disabled_since) {
            uint64_t off = avr->cycle - emulator->disabled_since;
            if (off > emulator->probes.off_longest) {
                emulator->probes.off_longest = off;
            }
        }
        emulator->interrupts_used = true;
        emulator->disabled_since = 0;
    } else if (!emulator->disabled_since) {
        emulator->disabled_since = avr->cycle;
    }
}

#endif

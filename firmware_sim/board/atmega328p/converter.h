/* The MAX31856 thermocouple converter on the SPI. */
#ifndef CONVERTER_H
#define CONVERTER_H

#include <stdbool.h>
#include <stdint.h>

enum converter_status {
    CONVERTER_SAME,  /* good, and no new conversion */
    CONVERTER_NEW,   /* a conversion has ended */
    CONVERTER_OPEN,  /* the circuit is open */
    CONVERTER_SHORT, /* an input is above the supply or below ground */
    CONVERTER_SILENT /* it does not answer, or its settings are lost */
};

struct converter_reading {
    int16_t temperature;   /* 0.01 degC */
    int16_t cold_junction; /* 0.01 degC */
};

void converter_begin(void);

/* Reads the chip, which takes less than 60 us. `reading` changes with CONVERTER_NEW. */
enum converter_status converter_read(struct converter_reading *reading);

#endif

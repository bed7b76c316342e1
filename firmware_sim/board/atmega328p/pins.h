/* The pins of the Arduino Nano or Uno. docs/board.md, "Pins". */
#ifndef PINS_H
#define PINS_H

#include <avr/io.h>

#define CONVERTER_SELECT _BV(PB2) /* D10, output; also the SS pin, which keeps the SPI a master */
#define SPI_DATA_OUT _BV(PB3)     /* D11 */
#define SPI_CLOCK _BV(PB5)        /* D13 */
#define CONVERTER_READY _BV(PD2)  /* D2, low when a conversion has ended */
#define ESTOP_OPEN _BV(PD3)       /* D3, low while the contact to ground is closed */
#define ENABLE _BV(PD4)           /* D4, the enable line; a resistor pulls it to ground */
#define JUMPER _BV(PD5)           /* D5, low when a displacement sensor is fitted */
#define I2C_DATA _BV(PC4)         /* A4 */
#define I2C_CLOCK _BV(PC5)        /* A5 */

#endif

/* The serial line: USART0 at 115200 bits/s, 8N1, between ring buffers. Timer 2 measures the pause after a byte. */
#ifndef LINE_H
#define LINE_H

#include <stdbool.h>
#include <stdint.h>

void line_begin(void);

#define LINE_PAUSE 0x100 /* set in a byte before which the line was silent for 1.75 ms */
#define LINE_BYTE 0xFF

/* The oldest byte that has arrived, perhaps with LINE_PAUSE, or -1. */
int16_t line_read(void);

/* True once after a silence of 1.75 ms that no byte has followed yet. */
bool line_take_pause(void);

/* True when line_read or line_take_pause has something. Call it with interrupts disabled. */
bool line_is_pending(void);

/* Sends `count` bytes, at most 63. Bytes for which there is no room are dropped. */
void line_send(const uint8_t *bytes, uint8_t count);

#endif

/* The safety interrupt: sensors, faults, watchdog, limits and current, every 10 ms. */
#ifndef SAFETY_H
#define SAFETY_H

#include <stdbool.h>
#include <stdint.h>

#include "../core/board.h"

/* Starts the interrupt for `board`. `passed` is the result of the self-test. */
void safety_begin(struct board *board, bool passed);

/* True from the first conversion of the thermocouple on, or when a fault is detected. */
bool safety_has_readings(void);

/* Time since power-up, ms. */
uint32_t safety_now_ms(void);

#endif

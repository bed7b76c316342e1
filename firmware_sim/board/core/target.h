/* What a target gives to the core. docs/sma-reference.md, "On a microcontroller".
 *
 * Between board_lock and board_unlock the safety interrupt does not run. A target masks only this interrupt, so that no
 * byte of the line is lost. The two are called in pairs, never nested, and only by the main loop.
 */
#ifndef TARGET_H
#define TARGET_H

void board_lock(void);
void board_unlock(void);

#endif

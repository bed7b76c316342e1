/* Wires of 0.25 to 0.5 mm. docs/board.md, "Ranges". */
#ifndef SUPPLY_LIMIT
#define SUPPLY_LIMIT 45000u
#endif
#define SOURCE_FULL_SCALE 51200u
#define SHUNT_MICROOHM 10000u /* 8.2 A at 81.9 mV */

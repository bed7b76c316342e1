/* The exceptions of Modbus that the board sends. docs/sma-reference.md, "Line". */
#ifndef EXCEPTIONS_H
#define EXCEPTIONS_H

#define EXCEPTION_NONE 0u
#define EXCEPTION_FUNCTION 1u
#define EXCEPTION_ADDRESS 2u
#define EXCEPTION_VALUE 3u
#define EXCEPTION_STATE 4u

#endif

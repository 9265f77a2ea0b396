/* SPDX-License-Identifier: MIT */
/* The bytes that a UART reads from a line whose sender has another rate.
 *
 * In: bytes as they were sent, one after the other, and both rates. Out: bytes as they are read. Pure.
 *
 * The sender: a start bit (0), eight data bits, the lowest first, and a stop bit (1); before and after its bytes the
 * line is at 1. The receiver waits for a falling edge. From there it looks at the line in the middle of each of its own
 * bits: 0.5 for the start bit, which must be 0, 1.5 to 8.5 for the data, 9.5 for the stop bit. Then it waits for the
 * next falling edge. (ATmega328P's data sheet, "Asynchronous Data Recovery", describes such a receiver. The receiver is
 * taken as ideal here: real ones find the edge to a sixteenth of a bit.)
 * All samples are right where the sender is less than 5.2 % faster, or 5.2 % slower. */
#ifndef DRIVERS_LINK_UART_H
#define DRIVERS_LINK_UART_H

#include <stddef.h>
#include <stdint.h>

/* A byte needs a falling edge, and the ten bits of a sent byte have five at most. */
enum { UART_MOST_PER_BYTE = 5 };

/* The receiver's driver keeps a byte whose stop bit was 0, makes it 0, or drops it. A byte of 0 with such a stop bit is
 * a break: the driver passes it on, unless drops_breaks is set. */
enum uart_errors { UART_KEEPS_ERRORS, UART_ZEROES_ERRORS, UART_DROPS_ERRORS };

struct uart {
    uint32_t sender_baud, receiver_baud; /* above 0 */
    enum uart_errors errors;
    int drops_breaks; /* the driver drops bytes of 0 whose stop bit was 0 */
};

/* Whether each byte is read as it was sent. */
int uart_reads_right(const struct uart *uart);
/* Returns how many bytes were read. out has room for UART_MOST_PER_BYTE times n. */
size_t uart_read(const struct uart *uart, const uint8_t *sent, size_t n, uint8_t *out);

#endif

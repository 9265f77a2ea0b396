/* SPDX-License-Identifier: MIT */
#include "drivers/link/uart.h"

enum { START = 0, STOP = 9, BITS = 10 };

/* Returns the number of the sender's bit in which the receiver's sample number k lies, counted from the falling edge.
 * The number is (k + 1/2) times the ratio of the rates, rounded down; whole numbers make it exact. */
static uint64_t bit_at(const struct uart *uart, unsigned k)
{
    return (2 * k + UINT64_C(1)) * uart->sender_baud / (2 * (uint64_t)uart->receiver_baud);
}

int uart_reads_right(const struct uart *uart)
{
    unsigned k = START;
    while (k < BITS && bit_at(uart, k) == k)
        k++;
    return k == BITS;
}

/* Returns the level of the line at a bit of the sender. */
static unsigned level_at(const uint8_t *sent, size_t n, uint64_t bit)
{
    const uint64_t byte = bit / BITS;
    const unsigned k = (unsigned)(bit % BITS);
    if (byte >= n || k == STOP) return 1;
    return k == START ? 0U : sent[byte] >> (k - 1) & 1U;
}

/* Returns whether the driver passes the byte on. */
static int uart_take(const struct uart *uart, unsigned stop, uint8_t *byte)
{
    if (stop != 0) return 1;
    if (*byte == 0) return !uart->drops_breaks;
    if (uart->errors == UART_ZEROES_ERRORS) *byte = 0;
    return uart->errors != UART_DROPS_ERRORS;
}

size_t uart_read(const struct uart *uart, const uint8_t *sent, size_t n, uint8_t *out)
{
    const uint64_t end = (uint64_t)n * BITS;
    size_t n_out = 0;
    unsigned before = 1; /* the level of the bit before */
    for (uint64_t bit = 0; bit < end;) {
        const unsigned level = level_at(sent, n, bit);
        const int falls = before == 1 && level == 0;
        before = level;
        if (!falls) {
            bit++;
            continue;
        }
        unsigned last = START; /* a low level that ends before the middle of a bit is no start bit */
        uint8_t byte = 0;
        if (level_at(sent, n, bit + bit_at(uart, START)) == 0) {
            for (unsigned k = 1; k < STOP; k++)
                byte |= (uint8_t)(level_at(sent, n, bit + bit_at(uart, k)) << (k - 1));
            last = STOP;
        }
        bit += bit_at(uart, last); /* the receiver waits for the next edge from its last sample on */
        before = level_at(sent, n, bit++);
        if (last == STOP && uart_take(uart, before, &byte)) out[n_out++] = byte;
    }
    return n_out;
}

/* SPDX-License-Identifier: MIT */
#include "drivers/link/pty_rate.h"

#include <asm/termbits.h>
#include <sys/ioctl.h>

/* The master's ioctls for settings act on the slave. Without INPCK Linux's drivers pass on a byte with a wrong stop bit
 * as it was sampled. PARMRK's marks can't be made on a pseudo terminal, whose line discipline would mark them again, so
 * its client gets 0. */
int pty_rate_differs(int master, uint32_t baud, int to_client, struct uart *uart)
{
    struct termios2 settings;
    *uart = (struct uart){baud, baud, UART_KEEPS_ERRORS, 0};
    if (baud == 0 || ioctl(master, TCGETS2, &settings) != 0) return 0;
    if (!to_client) {
        if (settings.c_ospeed != 0) uart->sender_baud = settings.c_ospeed;
        return !uart_reads_right(uart);
    }
    if (settings.c_ispeed != 0) uart->receiver_baud = settings.c_ispeed;
    if ((settings.c_iflag & INPCK) != 0)
        uart->errors = (settings.c_iflag & IGNPAR) != 0 ? UART_DROPS_ERRORS : UART_ZEROES_ERRORS;
    uart->drops_breaks = (settings.c_iflag & IGNBRK) != 0;
    return !uart_reads_right(uart);
}

/* SPDX-License-Identifier: MIT */
/* Bytes to lines. */
#include "firmware_sim/command/command.h"

static char line_char(unsigned char byte)
{
    if (byte == '\t') return ' ';
    return byte < 0x20 || byte > 0x7e ? '~' : (char)byte;
}

enum command_line_kind command_lines_feed(struct command_lines *lines, unsigned char byte)
{
    const int after_cr = lines->last_cr;
    lines->last_cr = byte == '\r';
    if (byte == '\n' && after_cr) return COMMAND_LINE_NONE;
    if (byte == '\n' || byte == '\r') {
        const int overrun = lines->overrun;
        lines->buf[overrun ? 0 : lines->len] = '\0';
        lines->len = 0;
        lines->overrun = 0;
        return overrun ? COMMAND_LINE_OVERRUN : COMMAND_LINE_READY;
    }
    if (lines->len < COMMAND_MAX_LINE)
        lines->buf[lines->len++] = line_char(byte);
    else
        lines->overrun = 1;
    return COMMAND_LINE_NONE;
}

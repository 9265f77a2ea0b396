/* SPDX-License-Identifier: MIT */
#include "firmware_sim/fault/wire_heard.h"

#include <stdlib.h>
#include <string.h>

#include "core/grow.h"

enum { HEARD_MAX = 65536, LINE_MAX_LEN = 256 /* longer lines are answered, too; this much of them is kept */ };

static void wire_heard_keep(struct wire_heard *heard, const uint8_t *bytes, size_t len)
{
    if (heard->first > heard->len / 2) { /* seldom, so that many lines at once cost no time */
        heard->len -= heard->first;
        heard->begin -= heard->first;
        memmove(heard->bytes, heard->bytes + heard->first, heard->len);
        heard->first = 0;
    }
    if (heard->len - heard->first + len > HEARD_MAX)
        heard->len = heard->begin = heard->first = 0; /* too much without an answer */
    if (!grow(&heard->bytes, &heard->room, heard->len + len, 1)) return;
    memcpy(heard->bytes + heard->len, bytes, len);
    heard->len += len;
}

/* Lines of blanks get no answer (command_lines_feed), unless they are too long. */
static void end_line(struct wire_heard *heard)
{
    if (heard->line_len == 0 || (heard->is_blank && heard->line_len <= LINE_MAX_LEN))
        heard->len = heard->begin;
    else
        wire_heard_keep(heard, (const uint8_t *)"\n", 1);
    heard->begin = heard->len;
    heard->line_len = 0;
}

static void add_byte(struct wire_heard *heard, uint8_t byte)
{
    if (byte == '\r' || byte == '\n') { /* CR LF ends a line, and then one without a byte, which gets no answer */
        end_line(heard);
        return;
    }
    if (heard->line_len == 0) heard->is_blank = 1;
    heard->is_blank &= byte == ' ' || byte == '\t';
    if (heard->line_len++ < LINE_MAX_LEN) wire_heard_keep(heard, &byte, 1);
}

void wire_heard_add(struct wire_heard *heard, const void *bytes, size_t len)
{
    const uint8_t *from = bytes;
    if (!heard->has_lines && len <= HEARD_MAX) wire_heard_keep(heard, bytes, len);
    for (size_t i = 0; heard->has_lines && i < len; i++)
        add_byte(heard, from[i]);
}

const uint8_t *wire_heard_first(const struct wire_heard *heard, size_t *len)
{
    *len = (heard->has_lines ? heard->begin : heard->len) - heard->first;
    if (*len == 0) return NULL;
    const uint8_t *first = heard->bytes + heard->first;
    if (heard->has_lines) *len = (size_t)((const uint8_t *)memchr(first, '\n', *len) - first);
    return first;
}

void wire_heard_answered(struct wire_heard *heard)
{
    size_t n;
    if (!heard->has_lines) {
        heard->len = 0;
    } else if (wire_heard_first(heard, &n) != NULL) {
        heard->first += n + 1;
    }
}

void wire_heard_free(struct wire_heard *heard)
{
    free(heard->bytes);
    *heard = (struct wire_heard){.has_lines = heard->has_lines};
}

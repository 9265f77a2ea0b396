/* SPDX-License-Identifier: MIT */
/* For injected faults: marks the data of replies, and corrects their sums. */
#include <string.h>

#include "drivers/protocol/scip_reply.h"

/* Lines of a reply, by number. */
enum { ECHO, STATUS, TIME, DATA };

struct line {
    size_t at, len; /* len: without LF; its last character is the sum */
    size_t number;
};

/* Finds the next line that has its end. Returns 0: there is none. */
static int next_line(const uint8_t *unit, size_t len, struct line *line)
{
    const size_t at = line->number == SIZE_MAX ? 0 : line->at + line->len + 1;
    const uint8_t *end = at < len ? memchr(unit + at, '\n', len - at) : NULL;
    if (end == NULL) return 0;
    *line = (struct line){at, (size_t)(end - unit) - at, line->number + 1};
    return 1;
}

/* Whether the reply is a scan: G, H, M, N, also with % before it. A reply has a whole line, so a byte follows a %. */
static int is_scan(const uint8_t *unit)
{
    const uint8_t first = unit[unit[0] == '%'];
    return strchr("GHMN", first) != NULL && first != 0;
}

/* A character of data is 0x30 plus six bits. Any change of the lower four gives another such character. */
void scip_content(const uint8_t *unit, size_t len, uint8_t *mask)
{
    struct line line = {.number = SIZE_MAX};
    while (next_line(unit, len, &line) && is_scan(unit))
        for (size_t i = line.at; line.number >= DATA && i + 1 < line.at + line.len; i++)
            if (unit[i] >= 0x30 && unit[i] <= 0x6f) mask[i] = 0x0f;
}

/* Lines of replies to VV, PP and II are "KEY:value;" and the sum of the characters before the ';'. Data of a scan may
 * end in ';', too, but there the sum has the ';'. */
void scip_reseal(uint8_t *unit, size_t len)
{
    struct line line = {.number = SIZE_MAX};
    while (next_line(unit, len, &line)) {
        uint8_t *bytes = unit + line.at;
        if (line.number == ECHO || line.len < 2) continue;
        const int is_key = line.number > STATUS && !is_scan(unit) && bytes[line.len - 2] == ';';
        bytes[line.len - 1] = (uint8_t)scip_sum(bytes, line.len - (is_key ? 2 : 1));
    }
}

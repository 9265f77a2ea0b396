/* SPDX-License-Identifier: MIT */
#include "drivers/record/e57_note.h"

#include <math.h>
#include <string.h>

#include "core/bytes.h"

enum { HAS_GEOID = 1, HAS_EMPTY = 2, HAS_COLOURS = 4, HAS_START = 8, ALL_BITS = 15 };
static const char MAGIC[16] = "scanhead e57 1";

void e57_note_put(const struct e57_facts *facts, const struct e57_scan *scan, uint8_t out[E57_NOTE_LEN])
{
    memset(out, 0, E57_NOTE_LEN);
    le_put64(out + 8, E57_NOTE_LEN);
    memcpy(out + 16, MAGIC, sizeof MAGIC);
    le_put32(out + 32, scan->number);
    le_put32(out + 36, scan->station);
    le_put32(out + 40, (uint32_t)facts->epsg);
    le_put32(out + 44, (facts->geoid_heights ? HAS_GEOID : 0u) | (facts->empty_shots ? HAS_EMPTY : 0u) |
                           (facts->has_colours ? HAS_COLOURS : 0u) | (scan->have_start ? HAS_START : 0u));
    le_put_double(out + 48, scan->scale_m);
    le_put_double(out + 56, scan->start_gps_s);
    for (size_t i = 0; i < 3; i++)
        le_put_double(out + 64 + 8 * i, scan->pose.shift_m[i]);
    for (size_t i = 0; i < 9; i++)
        le_put_double(out + 88 + 8 * i, scan->pose.rotation[i]);
    memcpy(out + 160, scan->idn, sizeof scan->idn);
    memcpy(out + 256, scan->profile, sizeof scan->profile);
}

int e57_note_get(const uint8_t note[E57_NOTE_LEN], struct e57_facts *facts, struct e57_scan *scan)
{
    static const uint8_t type[8];
    const uint32_t bits = le_get32(note + 44);
    if (memcmp(note, type, sizeof type) != 0 || le_get64(note + 8) != E57_NOTE_LEN ||
        memcmp(note + 16, MAGIC, sizeof MAGIC) != 0 || bits > ALL_BITS)
        return -1;
    scan->number = le_get32(note + 32);
    scan->station = le_get32(note + 36);
    facts->epsg = (int)le_get32(note + 40);
    facts->geoid_heights = (bits & HAS_GEOID) != 0;
    facts->empty_shots = (bits & HAS_EMPTY) != 0;
    facts->has_colours = (bits & HAS_COLOURS) != 0;
    scan->have_start = (bits & HAS_START) != 0;
    scan->scale_m = le_get_double(note + 48);
    scan->start_gps_s = le_get_double(note + 56);
    for (size_t i = 0; i < 3; i++)
        scan->pose.shift_m[i] = le_get_double(note + 64 + 8 * i);
    for (size_t i = 0; i < 9; i++)
        scan->pose.rotation[i] = le_get_double(note + 88 + 8 * i);
    memcpy(scan->idn, note + 160, sizeof scan->idn);
    memcpy(scan->profile, note + 256, sizeof scan->profile);
    scan->idn[sizeof scan->idn - 1] = scan->profile[sizeof scan->profile - 1] = 0;
    return scan->scale_m > 0 && isfinite(scan->scale_m) ? 0 : -1;
}

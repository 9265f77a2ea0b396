/* SPDX-License-Identifier: MIT */
/* Units of a faulty session against those of a clean one: what the session's faults must have made of them, by the
 * truth that the head wrote alone, and whether that is what came. Nothing of the program's faults is used. */
#ifndef TESTS_WIRE_UNIT_FAULTS_H
#define TESTS_WIRE_UNIT_FAULTS_H

#include "tests/wire/wire.h"

/* Bytes in units. */
struct unit_list {
    uint8_t *bytes;
    size_t len, room;
    size_t *end; /* of each unit */
    uint32_t n;
};

void units_add(struct unit_list *list, const void *bytes, size_t len);
/* Counts what was added as one unit more, as a datagram is. */
void units_end(struct unit_list *list);
/* Cuts into units what lies behind the last one. whole: the length of the unit at the beginning; 0: it is not whole. */
void units_cut(struct unit_list *list, size_t (*whole)(const uint8_t *bytes, size_t len));
const uint8_t *units_get(const struct unit_list *list, uint32_t i, size_t *len);
void units_free(struct unit_list *list);

/* How a protocol's units are looked at. */
struct unit_kind {
    size_t (*whole)(const uint8_t *bytes, size_t len);
    /* Makes of a clean unit what the faulty session must have sent as its unit `number`, from 1; NULL: the same. */
    void (*adapt)(uint8_t *unit, size_t len, uint64_t number);
    /* Whether its checksums are right; NULL: it has none. */
    int (*is_sound)(const uint8_t *unit, size_t len);
    int datagrams; /* 1: each is compared by itself */
};

/* A line of the truth. */
struct truth_note {
    char kind[24], of[12], text[64];
    uint64_t number, n;
    int64_t byte; /* -1: none */
};

/* The truth about a link, from 1; free() it. */
struct truth_note *truth_read(const char *path, int link, uint32_t *n);
uint32_t truth_count(const struct truth_note *note, uint32_t n, const char *kind);

/* Asserts that `got` is what the truth makes of the clean units: all of it, as far as it goes, at least `least` units.
 * The first unit of `got` has no fault; it shows which of the clean ones was the first of this session. Returns how
 * many there were. */
uint32_t units_check(const struct unit_kind *kind, const struct unit_list *clean, const struct unit_list *got,
                     const struct truth_note *note, uint32_t n_notes, uint32_t least);

/* The units that the truth makes of the clean ones, for a session that began with these. Faults that make unknown bytes
 * of them, or other units than there are, are none of them: flip, garbage, split, merge. */
void units_expect(const struct unit_list *clean, const struct truth_note *note, uint32_t n_notes,
                  struct unit_list *out);

/* Reads both sockets until each has so many bytes: in pace fast each holds the head back. fd1 -1, list1 NULL: one. */
void units_read_both(int fd0, struct unit_list *list0, int fd1, struct unit_list *list1, size_t least);

#endif

/* SPDX-License-Identifier: MIT */
/* Compares the units of a faulty session with those of a clean one. The truth that the head wrote gives the expected
 * changes. Nothing of the program's faults is used. */
#ifndef TESTS_WIRE_UNIT_FAULTS_H
#define TESTS_WIRE_UNIT_FAULTS_H

#include "tests/wire/wire.h"

/* A list of units, as bytes. */
struct unit_list {
    uint8_t *bytes;
    size_t len, room;
    size_t *end; /* of each unit */
    uint32_t n;
};

void units_add(struct unit_list *list, const void *bytes, size_t len);
/* Counts the added bytes as one more unit, as for a datagram. */
void units_end(struct unit_list *list);
/* Cuts the bytes after the last unit into units. whole: returns the length of the unit at the beginning; 0: it is not
 * whole. */
void units_cut(struct unit_list *list, size_t (*whole)(const uint8_t *bytes, size_t len));
const uint8_t *units_get(const struct unit_list *list, uint32_t i, size_t *len);
void units_free(struct unit_list *list);

/* How a protocol's units are compared. */
struct unit_kind {
    size_t (*whole)(const uint8_t *bytes, size_t len);
    /* Changes a clean unit to what the faulty session must have sent as its unit `number`, from 1; NULL: it is the
     * same. */
    void (*adapt)(uint8_t *unit, size_t len, uint64_t number);
    /* Returns whether its checksums are right; NULL: it has none. */
    int (*is_sound)(const uint8_t *unit, size_t len);
    int datagrams; /* 1: each is compared by itself */
};

/* This is a line of the truth. */
struct truth_note {
    char kind[24], of[12], text[64];
    uint64_t number, n;
    int64_t byte; /* -1: none */
};

/* Reads the truth about a link, from 1; free() it. */
struct truth_note *truth_read(const char *path, int link, uint32_t *n);
uint32_t truth_count(const struct truth_note *note, uint32_t n, const char *kind);

/* Asserts that the clean units, changed by the truth, give `got`: all of it, and at least `least` units. The first
 * unit of `got` has no fault; it shows which of the clean ones was the first of this session. Returns how many there
 * were. */
uint32_t units_check(const struct unit_kind *kind, const struct unit_list *clean, const struct unit_list *got,
                     const struct truth_note *note, uint32_t n_notes, uint32_t least);

/* Writes the units that the truth makes of the clean ones, for a session that began with these. Faults with unknown
 * bytes, or with another number of units, are not allowed: flip, garbage, split, merge. */
void units_expect(const struct unit_list *clean, const struct truth_note *note, uint32_t n_notes,
                  struct unit_list *out);

/* Reads both sockets until each has so many bytes, as in pace fast each holds the head back. fd1 -1, list1 NULL:
 * one. */
void units_read_both(int fd0, struct unit_list *list0, int fd1, struct unit_list *list1, size_t least);

#endif

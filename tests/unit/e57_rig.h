/* SPDX-License-Identifier: MIT */
/* A small reader of E57 files: pages, sections, packets and bit streams of ASTM E2807. The reader shares nothing with
 * the project's writer, and holds one file at a time. */
#ifndef TESTS_UNIT_E57_RIG_H
#define TESTS_UNIT_E57_RIG_H

#include "tests/unit/recorder_rig.h"

struct e57rig_record {
    double x, y, z, intensity, t_s;
    unsigned invalid, no_intensity, echo, echoes;
    uint32_t row, column;
    unsigned label;
    uint8_t rgb[3]; /* where there are colours */
};
extern struct e57rig_record e57rig_record[8192];
extern size_t e57rig_n_records, e57rig_n_packets; /* of the scan that was read last */
extern char *e57rig_xml;                          /* the XML section, as a string */

/* Checks the CRCs and the file's header, and finds the XML. */
void e57rig_read(const char *path);
/* Records the stream into a file, reads it, and removes it. Where the recorder fails, the test fails. */
void e57rig_record_one(struct recorder_options options);
/* Reads scan k of the file, from 0, by the XML. */
void e57rig_scan(int k, int empty_shots, int coloured);
/* Returns the value of the first such element. */
double e57rig_number(const char *from, const char *tag);
void e57rig_free(void);

#endif

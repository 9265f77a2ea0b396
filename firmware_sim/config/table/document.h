/* SPDX-License-Identifier: MIT */
/* Reads a file or a text, which is one YAML document, into a struct. Then values of --set replace those of the file.
 * Diagnostics of values go to the reader's list. */
#ifndef FIRMWARE_SIM_CONFIG_TABLE_DOCUMENT_H
#define FIRMWARE_SIM_CONFIG_TABLE_DOCUMENT_H

#include <stddef.h>
#include <stdint.h>

struct cfg_key;
struct cfg_reader;

/* Returns SH_OK, or the code of a diagnostic that leaves nothing to check: no file, no YAML, no keys. */
int cfg_read_file(struct cfg_reader *rd);
/* Does the same, and leaves the document open, for the scanner. *doc is NULL after an error. */
struct cfg_document;
int cfg_open_file(struct cfg_reader *rd, struct cfg_document **doc);
/* Does the same with a text in memory. */
int cfg_open_text(struct cfg_reader *rd, const unsigned char *bytes, size_t len, struct cfg_document **doc);
void cfg_close_file(struct cfg_document *doc);
/* Reads the section `scanner` of rd->scanner over the values that were read before. rd->in_scanner has to be 1. */
void cfg_read_scanner(struct cfg_reader *rd, struct cfg_document *doc);
/* Applies the values of --set for the file's own keys or, where rd->in_scanner is 1, those for the scanner's. The
 * others are skipped. doc: the file's document. A value of --set that is YAML is parsed, and stored in doc. */
void cfg_apply_sets(struct cfg_reader *rd, struct cfg_document *doc, const char *const *sets, int n_sets);
/* Reads a list or a section from YAML in a --set. The key must have been forgotten before (cfg_forget). */
void cfg_read_set_value(struct cfg_reader *rd, struct cfg_document *doc, const struct cfg_key *key, uint32_t item,
                        const char *text);

#endif

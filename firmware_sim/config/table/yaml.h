/* SPDX-License-Identifier: MIT */
/* Private to this folder: a file's one document, and its parts that are read later. */
#ifndef FIRMWARE_SIM_CONFIG_TABLE_YAML_H
#define FIRMWARE_SIM_CONFIG_TABLE_YAML_H

#include <yaml.h>

#include "firmware_sim/config/table/reader.h"

struct cfg_document {
    yaml_document_t doc;
    const yaml_node_t *scanner[CFG_MAX_ITEMS];      /* by station; NULL: it has none */
    struct cfg_document *scanner_of[CFG_MAX_ITEMS]; /* the document with that node: this one, or a value of --set */
    struct cfg_document *values;                    /* values of --set, which live as long as this document */
};

/* Returns the place of a mark, from 1: in a file its line, in a value of --set its character. */
static inline int cfg_line_of(const struct cfg_reader *rd, yaml_mark_t mark)
{
    return (int)(rd->set != NULL ? mark.index : mark.line) + 1;
}

/* Reads the document by the rows of the table, except the scanners of stations. SH_EINPUT: the document is no
 * section. */
int cfg_read_document(struct cfg_reader *rd, struct cfg_document *doc);
/* Parses a text that is one document; cfg_read_document then reads it. *doc is NULL after an error. */
int cfg_parse_text(struct cfg_reader *rd, const unsigned char *bytes, size_t len, struct cfg_document **doc);

#endif

/* Private to yaml.c and yaml_file.c: a file's one document, and what is read of it later. */
#ifndef FIRMWARE_SIM_CONFIG_YAML_H
#define FIRMWARE_SIM_CONFIG_YAML_H

#include <yaml.h>

#include "firmware_sim/config/table.h"

struct cfg_document {
    yaml_document_t doc;
    const yaml_node_t *scanner[CFG_MAX_ITEMS]; /* by station; NULL: it has none */
};

/* The line of a node, from 1. */
static inline int cfg_line_of(const yaml_node_t *node)
{
    return (int)node->start_mark.line + 1;
}

/* All of it by the rows, but the scanners of stations. SH_EINPUT where there is no section. */
int cfg_read_document(struct cfg_reader *rd, struct cfg_document *doc);

#endif

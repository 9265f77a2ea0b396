/* SPDX-License-Identifier: MIT */
/* YAML to the struct, by the table. libyaml's document API keeps the line of each node. */
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/copies.h"
#include "firmware_sim/config/profiles.h"
#include "firmware_sim/config/table/diagnostics.h"
#include "firmware_sim/config/table/document.h"
#include "firmware_sim/config/table/forget.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"
#include "firmware_sim/config/table/yaml.h"

#include <stdio.h>
#include <string.h>

struct walk {
    struct cfg_reader *rd;
    yaml_document_t *doc;
    struct cfg_document *of;   /* with doc in it */
    struct cfg_document *main; /* the file's document, which keeps the scanners of all stations */
    int from_set;
    char base_dir[CONFIG_PATH_LEN];
};

static int line_of(const struct walk *w, const yaml_node_t *node)
{
    return w->from_set ? CFG_FROM_SET : cfg_line_of(w->rd, node->start_mark);
}

static const char *text_of(const yaml_node_t *node)
{
    return (const char *)node->data.scalar.value;
}

/* "null" is a value like any other, not YAML's nothing: it is a type of link (links[].type). */
static int is_nothing(const yaml_node_t *node)
{
    return node->type == YAML_SCALAR_NODE && node->data.scalar.style == YAML_PLAIN_SCALAR_STYLE &&
           (node->data.scalar.length == 0 || strcmp(text_of(node), "~") == 0);
}

static const char *kind_of(const yaml_node_t *node)
{
    switch (node->type) {
    case YAML_SCALAR_NODE:
        return is_nothing(node) ? "nothing" : "a single value";
    case YAML_SEQUENCE_NODE:
        return "a list";
    default:
        return "a section with keys";
    }
}

/* Tags would change what a value means; none is known here. */
static int has_tag(const yaml_node_t *node)
{
    static const char *const plain[] = {
        [YAML_SCALAR_NODE] = YAML_STR_TAG, [YAML_SEQUENCE_NODE] = YAML_SEQ_TAG, [YAML_MAPPING_NODE] = YAML_MAP_TAG};
    return node->tag != NULL && strcmp((const char *)node->tag, plain[node->type]) != 0;
}

static int wrong_kind(const struct walk *w, const struct cfg_key *key, uint32_t item, const yaml_node_t *node)
{
    char allowed[CFG_ALLOWED_MAX];
    return cfg_fail_value(w->rd, key, item, line_of(w, node), "here stands %s; %s", kind_of(node),
                          cfg_allowed(key, w->rd->profile, allowed));
}

/* Checks that the node is a scalar that may stand for a value of this type. */
static int check_scalar(const struct walk *w, const struct cfg_key *key, uint32_t item, const yaml_node_t *node)
{
    char allowed[CFG_ALLOWED_MAX], shown[CFG_SHOW_MAX];
    if (node->type != YAML_SCALAR_NODE || is_nothing(node)) return wrong_kind(w, key, item, node);
    const int plain = node->data.scalar.style == YAML_PLAIN_SCALAR_STYLE;
    const char *why = NULL;
    int is_text = key->type == CFG_TEXT || key->type == CFG_PATH || key->type == CFG_ENUM;
    if (strlen(text_of(node)) != node->data.scalar.length) why = "text with control characters";
    if (!is_text && !plain) why = "a text in quotes or of several lines";
    if (has_tag(node)) why = "a value with a tag, which is not supported";
    if (why == NULL) return SH_OK;
    return cfg_fail_value(w->rd, key, item, line_of(w, node), "\"%s\" is %s; %s", cfg_show(text_of(node), shown), why,
                          cfg_allowed(key, w->rd->profile, allowed));
}

static void read_scalar(struct walk *w, const struct cfg_key *key, uint32_t item, const yaml_node_t *node)
{
    if (check_scalar(w, key, item, node) == SH_OK)
        cfg_store(w->rd, key, item, line_of(w, node), text_of(node), w->base_dir);
}

/* Reads the n numbers of a list. */
static void read_numbers(struct walk *w, const struct cfg_key *key, uint32_t item, const yaml_node_item_t *first, int n,
                         double *to)
{
    for (int i = 0; i < n; i++) {
        const yaml_node_t *number = yaml_document_get_node(w->doc, first[i]);
        if (check_scalar(w, key, item, number) == SH_OK)
            cfg_store_number(w->rd, key, item, line_of(w, number), to + i, text_of(number));
    }
}

static void read_vec3(struct walk *w, const struct cfg_key *key, uint32_t item, const yaml_node_t *node)
{
    char allowed[CFG_ALLOWED_MAX];
    const yaml_node_item_t *first = node->data.sequence.items.start, *top = node->data.sequence.items.top;
    if (top - first != cfg_axes(key))
        cfg_fail_value(w->rd, key, item, line_of(w, node), "has %td numbers instead of %d; %s", top - first,
                       cfg_axes(key), cfg_allowed(key, w->rd->profile, allowed));
    else
        read_numbers(w, key, item, first, cfg_axes(key), cfg_address(w->rd, key, item));
}

static void read_points(struct walk *w, const struct cfg_key *key, uint32_t item, const yaml_node_t *node)
{
    struct config_points *points = cfg_address(w->rd, key, item);
    char allowed[CFG_ALLOWED_MAX];
    const yaml_node_item_t *first = node->data.sequence.items.start, *top = node->data.sequence.items.top;
    if (top - first > CONFIG_MAX_POINTS) {
        cfg_fail_value(w->rd, key, item, line_of(w, node), "has %td points; allowed up to %d", top - first,
                       CONFIG_MAX_POINTS);
        return;
    }
    points->n = (uint32_t)(top - first);
    for (uint32_t i = 0; i < points->n; i++) {
        const yaml_node_t *pair = yaml_document_get_node(w->doc, first[i]);
        if (pair->type != YAML_SEQUENCE_NODE || pair->data.sequence.items.top - pair->data.sequence.items.start != 2) {
            cfg_fail_value(w->rd, key, item, line_of(w, pair), "point %u is not two numbers; %s", i + 1,
                           cfg_allowed(key, w->rd->profile, allowed));
            return;
        }
        read_numbers(w, key, item, pair->data.sequence.items.start, 2, points->at[i]);
    }
}

/* Returns the number of a word among names; -1: none of them. */
static int word_of(const yaml_node_t *node, const char *const *names)
{
    for (int i = 0; names[i] != NULL && node->type == YAML_SCALAR_NODE; i++)
        if (strcmp(text_of(node), names[i]) == 0) return i;
    return -1;
}

/* The parts of a figure. */
enum figure_part { FIGURE_VALUE, FIGURE_FROM, FIGURE_SOURCE, FIGURE_NOTE, FIGURE_DEFINITION, FIGURE_PARTS };
static const char *const figure_parts[] = {"value", "from", "source", "note", "definition", NULL};

static void refuse_part(struct walk *w, const struct cfg_key *key, uint32_t item, enum figure_part part,
                        const yaml_node_t *node)
{
    const char *const *words = part == FIGURE_FROM         ? cfg_from_names
                               : part == FIGURE_DEFINITION ? key->definitions
                                                           : NULL;
    char allowed[CFG_ALLOWED_MAX] = "";
    for (size_t i = 0; words != NULL && words[i] != NULL; i++)
        cfg_list_add(allowed, sizeof allowed, words[i]);
    cfg_fail_value(w->rd, key, item, line_of(w, node), "\"%s\" must say %s; allowed %s", figure_parts[part],
                   part == FIGURE_FROM         ? "where the figure is from"
                   : part == FIGURE_DEFINITION ? "how the width is defined"
                                               : "something in words",
                   words != NULL ? allowed : "a text in one line");
}

static int is_line_of_text(const yaml_node_t *node)
{
    if (node->type != YAML_SCALAR_NODE || node->data.scalar.length == 0) return 0;
    for (size_t i = 0; i < node->data.scalar.length; i++)
        if (node->data.scalar.value[i] < 0x20 || node->data.scalar.value[i] == 0x7f) return 0;
    return 1;
}

static void read_part(struct walk *w, const struct cfg_key *key, uint32_t item, enum figure_part part,
                      const yaml_node_t *node)
{
    int word = 0, sound = 1;
    switch (part) {
    case FIGURE_VALUE:
        read_scalar(w, key, item, node);
        return;
    case FIGURE_FROM:
        word = word_of(node, cfg_from_names);
        sound = word >= 0;
        w->rd->from[cfg_row(w->rd, key)][item] = (unsigned char)(word + 1);
        break;
    case FIGURE_DEFINITION:
        word = word_of(node, key->definitions);
        sound = word >= 0;
        if (sound) memcpy((char *)w->rd->base + key->definition_offset, &word, sizeof word);
        break;
    default: /* source and note are for readers of the file */
        sound = is_line_of_text(node);
    }
    if (!sound) refuse_part(w, key, item, part, node);
}

static void read_figure(struct walk *w, const struct cfg_key *key, uint32_t item, const yaml_node_t *node)
{
    static const char form[] = "allowed { value: V, from: data sheet }, or from: quoted, from: assumed";
    int given[FIGURE_PARTS] = {0};
    if (node->type != YAML_MAPPING_NODE) {
        cfg_fail_value(w->rd, key, item, line_of(w, node), "here stands %s; %s", kind_of(node), form);
        return;
    }
    for (const yaml_node_pair_t *pair = node->data.mapping.pairs.start; pair < node->data.mapping.pairs.top; pair++) {
        const yaml_node_t *word = yaml_document_get_node(w->doc, pair->key);
        const int part = word_of(word, figure_parts);
        if (part < 0 || given[part]++ || (part == FIGURE_DEFINITION && key->definitions == NULL)) {
            cfg_fail_value(w->rd, key, item, line_of(w, word),
                           "a key that is unknown or given twice; %s, then source, note%s", form,
                           key->definitions != NULL ? ", definition" : "");
            return;
        }
        read_part(w, key, item, (enum figure_part)part, yaml_document_get_node(w->doc, pair->value));
    }
    if (!given[FIGURE_VALUE] || !given[FIGURE_FROM])
        cfg_fail_value(w->rd, key, item, line_of(w, node), "\"%s\" is missing; %s", given[0] ? "from" : "value", form);
}

static void read_map(struct walk *w, const yaml_node_t *node, const char *path, uint32_t item);

static void read_list(struct walk *w, const struct cfg_key *key, const yaml_node_t *node)
{
    char allowed[CFG_ALLOWED_MAX];
    const yaml_node_item_t *first = node->data.sequence.items.start;
    ptrdiff_t n = node->data.sequence.items.top - first;
    if ((double)n > key->max) {
        cfg_fail_value(w->rd, key, 0, line_of(w, node), "%td elements are too many; %s", n,
                       cfg_allowed(key, w->rd->profile, allowed));
        return;
    }
    const struct cfg_key *element = key + 1;
    for (uint32_t i = 0; i < (uint32_t)n; i++) {
        const yaml_node_t *child = yaml_document_get_node(w->doc, first[i]);
        *cfg_list_count(w->rd, key) = i + 1;
        w->rd->line[cfg_row(w->rd, element)][i] = line_of(w, child);
        if (element->type != CFG_MAP)
            read_scalar(w, element, i, child);
        else if (child->type == YAML_MAPPING_NODE)
            read_map(w, child, element->path, i);
        else
            wrong_kind(w, element, i, child);
    }
}

/* A list within a list: each element has a reader of its own. */
static void read_copies(struct walk *w, const struct cfg_key *key, uint32_t item, const yaml_node_t *node)
{
    struct config_scene *scene = &((struct config *)w->rd->base)->scene;
    const yaml_node_item_t *first = node->data.sequence.items.start;
    const ptrdiff_t n = node->data.sequence.items.top - first;
    if (n == 0 || n > CONFIG_MAX_COPIES - (ptrdiff_t)scene->n_copies) {
        cfg_fail_value(w->rd, key, item, line_of(w, node),
                       "a list of %td copies; allowed 1 to %d of all meshes together, more in a CSV file", n,
                       CONFIG_MAX_COPIES);
        return;
    }
    for (ptrdiff_t i = 0; i < n; i++) {
        const yaml_node_t *child = yaml_document_get_node(w->doc, first[i]);
        struct cfg_reader rd;
        struct walk in = *w;
        char name[CFG_PATH_MAX];
        snprintf(name, sizeof name, "scene.meshes[%u].copies[%td]", item, i);
        cfg_begin_copy(&rd, w->rd, item, name, line_of(w, child));
        in.rd = &rd;
        if (child->type == YAML_MAPPING_NODE)
            read_map(&in, child, "", 0);
        else
            cfg_fail(&rd, line_of(w, child), name, "here stands %s; allowed a section with offset_m, turn_deg, scale",
                     kind_of(child));
        if (child->type == YAML_MAPPING_NODE) cfg_fill_defaults(&rd, NULL);
    }
}

/* Keeps the node until the station is known whose scanner is read. */
static void keep_scanner(struct walk *w, const struct cfg_key *key, uint32_t item, const yaml_node_t *node)
{
    struct config_station *station = cfg_address(w->rd, key, item);
    if (node->type != YAML_MAPPING_NODE) wrong_kind(w, key, item, node);
    station->has_scanner = node->type == YAML_MAPPING_NODE;
    w->main->scanner[item] = station->has_scanner ? node : NULL;
    w->main->scanner_of[item] = w->of;
}

/* Whether a value of the type is a sequence in YAML. */
static int wants_sequence(enum cfg_type type)
{
    return type == CFG_LIST || type == CFG_POINTS || type == CFG_VEC3 || type == CFG_PAIR;
}

static void read_value(struct walk *w, const struct cfg_key *key, uint32_t item, const yaml_node_t *node)
{
    if (node->type != YAML_SCALAR_NODE && has_tag(node)) {
        cfg_fail_value(w->rd, key, item, line_of(w, node), "has a tag; allowed none");
    } else if (key->flags & CFG_FIGURE) {
        read_figure(w, key, item, node);
    } else if (strcmp(key->path, "scene.meshes[].copies") == 0 && node->type == YAML_SEQUENCE_NODE) {
        read_copies(w, key, item, node);
    } else if (strcmp(key->path, "stations[].scanner") == 0) {
        keep_scanner(w, key, item, node);
    } else if (key->type == CFG_MAP && node->type == YAML_MAPPING_NODE) {
        read_map(w, node, key->path, item);
    } else if (key->type == CFG_MAP) {
        wrong_kind(w, key, item, node);
    } else if (wants_sequence(key->type) && node->type != YAML_SEQUENCE_NODE) {
        wrong_kind(w, key, item, node);
    } else if (key->type == CFG_LIST) {
        read_list(w, key, node);
    } else if (key->type == CFG_POINTS) {
        read_points(w, key, item, node);
    } else if (key->type == CFG_VEC3 || key->type == CFG_PAIR) {
        read_vec3(w, key, item, node);
    } else {
        read_scalar(w, key, item, node);
    }
}

/* Returns the row of a key below path, or NULL. A dotted key ("head.prr_hz: 1") is not accepted for a key in a
 * section. */
static const struct cfg_key *row_below(const struct walk *w, const char *path, const yaml_node_t *word)
{
    char full[CFG_PATH_MAX];
    if (word->data.scalar.length != strlen(text_of(word)) || strpbrk(text_of(word), ".[]") != NULL) return NULL;
    int len = snprintf(full, sizeof full, "%s%s%s", path, path[0] != '\0' ? "." : "", text_of(word));
    return len < (int)sizeof full ? cfg_find(&w->rd->table, full) : NULL;
}

static void read_pair(struct walk *w, const yaml_node_t *word, const yaml_node_t *value, const char *path,
                      uint32_t item)
{
    const int line = line_of(w, word);
    if (word->type != YAML_SCALAR_NODE) {
        cfg_fail(w->rd, line, path[0] != '\0' ? path : "configuration", "a key that is %s; allowed words only",
                 kind_of(word));
        return;
    }
    const struct cfg_key *key = row_below(w, path, word);
    if (key == NULL) {
        cfg_fail_unknown(w->rd, line, path, item, text_of(word));
        return;
    }
    if (w->rd->in_scanner && !cfg_is_of_scanner(key->path)) {
        char name[48 + CFG_PATH_MAX];
        snprintf(name, sizeof name, "stations[%d].scanner.%s", w->rd->scanner, key->path);
        cfg_fail(w->rd, line, name, "the same for all scanners; allowed %s", cfg_sections_of_scanner);
        return;
    }
    if (w->rd->in_scanner) cfg_take_over(w->rd, key);
    int *given = &w->rd->line[cfg_row(w->rd, key)][item];
    if (*given != 0) {
        char first[32] = "";
        if (!w->from_set) snprintf(first, sizeof first, ", first on line %d", *given);
        cfg_fail_value(w->rd, key, item, line, "given twice%s; allowed once", first);
        return;
    }
    *given = line;
    read_value(w, key, item, value);
}

/* Reports every diagnostic: one does not end the reading. */
static void read_map(struct walk *w, const yaml_node_t *node, const char *path, uint32_t item)
{
    for (const yaml_node_pair_t *pair = node->data.mapping.pairs.start; pair < node->data.mapping.pairs.top; pair++)
        read_pair(w, yaml_document_get_node(w->doc, pair->key), yaml_document_get_node(w->doc, pair->value), path,
                  item);
}

/* ---- the document */

/* of: the document to walk. It is main, which is the file's, or the document of a value of --set. */
static void begin_walk(struct walk *w, struct cfg_reader *rd, struct cfg_document *of, struct cfg_document *main)
{
    *w = (struct walk){.rd = rd, .doc = &of->doc, .of = of, .main = main, .from_set = of != main};
    if (!w->from_set) cfg_dir_of(rd->file, w->base_dir);
}

int cfg_read_document(struct cfg_reader *rd, struct cfg_document *doc)
{
    struct walk w;
    const yaml_node_t *root = yaml_document_get_root_node(&doc->doc);
    if (root == NULL) return cfg_fail_file(rd, SH_EINPUT, 1, "empty; a section with keys is needed");
    begin_walk(&w, rd, doc, doc);
    rd->root_line = line_of(&w, root);
    if (root->type != YAML_MAPPING_NODE)
        return cfg_fail_file(rd, SH_EINPUT, line_of(&w, root), "here stands %s; allowed sections with keys",
                             kind_of(root));
    read_map(&w, root, "", 0);
    return SH_OK;
}

void cfg_read_set_value(struct cfg_reader *rd, struct cfg_document *doc, const struct cfg_key *key, uint32_t item,
                        const char *text)
{
    struct walk w;
    struct cfg_document *value;
    char allowed[CFG_ALLOWED_MAX];
    rd->bad[cfg_row(rd, key)][item] = 1;
    if (cfg_parse_text(rd, (const unsigned char *)text, strlen(text), &value) != SH_OK) return;
    value->values = doc->values;
    doc->values = value;
    const yaml_node_t *root = yaml_document_get_root_node(&value->doc);
    if (root == NULL) {
        cfg_fail_value(rd, key, item, CFG_FROM_SET, "here stands nothing; %s", cfg_allowed(key, rd->profile, allowed));
        return;
    }
    rd->bad[cfg_row(rd, key)][item] = 0;
    begin_walk(&w, rd, value, doc);
    read_value(&w, key, item, root);
}

void cfg_read_scanner(struct cfg_reader *rd, struct cfg_document *doc)
{
    struct walk w;
    const yaml_node_t *node = doc->scanner[rd->scanner];
    if (node == NULL) return;
    begin_walk(&w, rd, doc->scanner_of[rd->scanner], doc);
    read_map(&w, node, "", 0);
}

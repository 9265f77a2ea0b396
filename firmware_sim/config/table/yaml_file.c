/* SPDX-License-Identifier: MIT */
/* A YAML file as one document: bytes, limits, syntax. */
#include "firmware_sim/config/table/diagnostics.h"
#include "firmware_sim/config/table/document.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/yaml.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/err.h"
#include "core/infile.h"

enum { FILE_MAX = 1 << 20, MAX_DEPTH = 16, MAX_ANCHORS = 256 };

static int read_bytes(struct cfg_reader *rd, unsigned char **bytes, size_t *len)
{
    const char *why;
    FILE *file = infile_open(rd->file, &why);
    if (file == NULL) return cfg_fail_file(rd, SH_EINPUT, 0, "cannot be opened: %s; a YAML file is needed", why);
    *bytes = malloc(FILE_MAX + 1);
    int code = SH_OK;
    if (*bytes == NULL) code = cfg_fail_file(rd, SH_ENOMEM, 0, "no memory to read it");
    *len = code == SH_OK ? fread(*bytes, 1, FILE_MAX + 1, file) : 0;
    if (code == SH_OK && ferror(file))
        code = cfg_fail_file(rd, SH_EINPUT, 0, "cannot be read: %s; a YAML file is needed", strerror(errno));
    if (code == SH_OK && *len > FILE_MAX)
        code = cfg_fail_file(rd, SH_EINPUT, 0, "larger than 1 MiB; allowed up to 1048576 bytes");
    fclose(file);
    return code;
}

/* Returns whether a line, counted from 1, begins with a tab after blanks. */
static int indented_by_tab(const unsigned char *bytes, size_t len, int line)
{
    const unsigned char *p = bytes, *end = bytes + len;
    while (p < end && line > 1)
        line -= *p++ == '\n';
    while (p < end && *p == ' ')
        p++;
    return p < end && *p == '\t';
}

/* libyaml gives a mark for what it scans and parses, and a byte offset for bytes that are not UTF-8. */
static int fail_syntax(struct cfg_reader *rd, const yaml_parser_t *parser, const unsigned char *bytes, size_t len)
{
    int line = cfg_line_of(rd, parser->problem_mark);
    if (parser->error == YAML_MEMORY_ERROR) return cfg_fail_file(rd, SH_ENOMEM, 0, "no memory to parse it");
    if (parser->error == YAML_READER_ERROR) {
        line = 1;
        for (size_t i = 0; i < parser->problem_offset && i < len; i++)
            line += rd->set != NULL || bytes[i] == '\n';
    }
    const char *hint =
        rd->set == NULL && indented_by_tab(bytes, len, line) ? "; indent with spaces, not with tabs" : "";
    if (parser->error == YAML_READER_ERROR) hint = "; allowed UTF-8 text without control characters";
    return cfg_fail_file(rd, SH_EINPUT, line, "not YAML: %s%s%s%s",
                         parser->problem != NULL ? parser->problem : "unknown problem",
                         parser->context != NULL ? " " : "", parser->context != NULL ? parser->context : "", hint);
}

/* A byte order mark is skipped here: libyaml would count it as a column and find the first line indented. */
static int start_parser(struct cfg_reader *rd, yaml_parser_t *parser, const unsigned char *bytes, size_t len)
{
    size_t skip = len >= 3 && memcmp(bytes, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
    if (!yaml_parser_initialize(parser)) return cfg_fail_file(rd, SH_ENOMEM, 0, "no memory to parse it");
    yaml_parser_set_encoding(parser, YAML_UTF8_ENCODING);
    yaml_parser_set_input_string(parser, bytes + skip, len - skip);
    return SH_OK;
}

/* libyaml's scanner takes time with the square of the depth of "[[[[", and of the number of anchors: both are
 * bounded by a first pass over the events. All other errors are left to the second. */
static int check_depth(struct cfg_reader *rd, const unsigned char *bytes, size_t len)
{
    yaml_parser_t parser;
    yaml_event_t event;
    int depth = 0, anchors = 0, done = 0;
    int code = start_parser(rd, &parser, bytes, len);
    if (code != SH_OK) return code;
    while (code == SH_OK && !done && yaml_parser_parse(&parser, &event)) {
        int line = cfg_line_of(rd, event.start_mark);
        done = event.type == YAML_STREAM_END_EVENT;
        depth += event.type == YAML_SEQUENCE_START_EVENT || event.type == YAML_MAPPING_START_EVENT;
        depth -= event.type == YAML_SEQUENCE_END_EVENT || event.type == YAML_MAPPING_END_EVENT;
        anchors += (event.type == YAML_SCALAR_EVENT && event.data.scalar.anchor != NULL) ||
                   (event.type == YAML_SEQUENCE_START_EVENT && event.data.sequence_start.anchor != NULL) ||
                   (event.type == YAML_MAPPING_START_EVENT && event.data.mapping_start.anchor != NULL);
        yaml_event_delete(&event);
        if (depth > MAX_DEPTH)
            code = cfg_fail_file(rd, SH_EINPUT, line, "nested too deep; allowed %d levels", MAX_DEPTH);
        else if (anchors > MAX_ANCHORS)
            code = cfg_fail_file(rd, SH_EINPUT, line, "too many anchors; allowed %d", MAX_ANCHORS);
    }
    yaml_parser_delete(&parser);
    return code;
}

void cfg_close_file(struct cfg_document *doc)
{
    while (doc != NULL) {
        struct cfg_document *next = doc->values;
        yaml_document_delete(&doc->doc);
        free(doc);
        doc = next;
    }
}

static int parse_one(struct cfg_reader *rd, yaml_parser_t *parser, const unsigned char *bytes, size_t len,
                     struct cfg_document **out)
{
    struct cfg_document *doc = calloc(1, sizeof *doc);
    if (doc == NULL) return cfg_fail_file(rd, SH_ENOMEM, 0, "no memory to parse it");
    if (!yaml_parser_load(parser, &doc->doc)) {
        free(doc);
        return fail_syntax(rd, parser, bytes, len);
    }
    *out = doc;
    return SH_OK;
}

static int check_end(struct cfg_reader *rd, yaml_parser_t *parser, const unsigned char *bytes, size_t len)
{
    yaml_document_t next;
    int code = SH_OK;
    if (!yaml_parser_load(parser, &next)) return fail_syntax(rd, parser, bytes, len);
    const yaml_node_t *more = yaml_document_get_root_node(&next);
    if (more != NULL)
        code = cfg_fail_file(rd, SH_EINPUT, cfg_line_of(rd, more->start_mark), "a second document; allowed one");
    yaml_document_delete(&next);
    return code;
}

/* Diagnostics of the document, which `read` finds, come before those of text after it. */
static int open_text(struct cfg_reader *rd, const unsigned char *bytes, size_t len,
                     int (*read)(struct cfg_reader *rd, struct cfg_document *doc), struct cfg_document **doc)
{
    yaml_parser_t parser;
    *doc = NULL;
    int code = check_depth(rd, bytes, len);
    if (code == SH_OK) code = start_parser(rd, &parser, bytes, len);
    if (code != SH_OK) return code;
    code = parse_one(rd, &parser, bytes, len, doc);
    if (code == SH_OK && read != NULL) code = read(rd, *doc);
    if (code == SH_OK) code = check_end(rd, &parser, bytes, len);
    yaml_parser_delete(&parser);
    if (code == SH_OK) return code;
    cfg_close_file(*doc);
    *doc = NULL;
    return code;
}

int cfg_open_text(struct cfg_reader *rd, const unsigned char *bytes, size_t len, struct cfg_document **doc)
{
    return open_text(rd, bytes, len, cfg_read_document, doc);
}

int cfg_parse_text(struct cfg_reader *rd, const unsigned char *bytes, size_t len, struct cfg_document **doc)
{
    return open_text(rd, bytes, len, NULL, doc);
}

int cfg_open_file(struct cfg_reader *rd, struct cfg_document **doc)
{
    unsigned char *bytes = NULL;
    size_t len = 0;
    *doc = NULL;
    int code = read_bytes(rd, &bytes, &len);
    if (code == SH_OK) code = cfg_open_text(rd, bytes, len, doc);
    free(bytes);
    return code;
}

int cfg_read_file(struct cfg_reader *rd)
{
    struct cfg_document *doc;
    int code = cfg_open_file(rd, &doc);
    cfg_close_file(doc);
    return code;
}

/* SPDX-License-Identifier: MIT */
#include "firmware_sim/fault/truth.h"

#include <errno.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/newfile.h"
#include "firmware_sim/base/json.h"
#include "firmware_sim/base/line_writer.h"

static const char *const of_names[] = {"stream", "notices", "replies"};

enum { QUEUE_BYTES = 1 << 20 };

struct truth {
    pthread_mutex_t lock;
    char text[LINE_MOST_BYTES]; /* the line at hand, as `line` has written it */
    FILE *line;
    struct line_writer *lines;
};

static void say_gap(char text[LINE_GAP_BYTES], const uint64_t lost[LINE_KINDS])
{
    snprintf(text, LINE_GAP_BYTES, "{\"missing\":%" PRIu64 "}\n", lost[LINE_PLAIN]);
}

/* Standard output gets a descriptor of its own, so that no other lines are in its buffer. */
static int open_stdout(int *fd, struct sh_err *err)
{
    *fd = dup(STDOUT_FILENO);
    return *fd >= 0 ? SH_OK : sh_fail(err, SH_EIO, "standard output: %s", strerror(errno));
}

int truth_open(const char *path, _Atomic uint64_t *lost, struct truth **out, struct sh_err *err)
{
    int fd;
    *out = NULL;
    if (path == NULL) return SH_OK;
    struct sh_err why = {0};
    const int to_stdout = strcmp(path, "-") == 0;
    int rc = to_stdout ? open_stdout(&fd, &why) : newfile_open(path, &fd, &why);
    if (rc != SH_OK) return sh_fail(err, rc, "truth: %s", why.text);
    if (to_stdout) path = "standard output";
    struct truth *truth = calloc(1, sizeof *truth);
    if (truth != NULL) truth->line = fmemopen(truth->text, sizeof truth->text, "w");
    if (truth == NULL || truth->line == NULL) {
        free(truth);
        close(fd);
        return sh_fail(err, SH_ENOMEM, "truth: %s: no memory", path);
    }
    const struct line_writer_spec spec = {
        .fd = fd, .what = "truth", .path = path, .room = QUEUE_BYTES, .lost = lost, .gap = say_gap};
    rc = line_writer_open(&spec, &truth->lines, err);
    if (rc != SH_OK) {
        fclose(truth->line);
        free(truth);
        return rc;
    }
    pthread_mutex_init(&truth->lock, NULL);
    *out = truth;
    return SH_OK;
}

static void put_place(struct json *json, const struct fault_note *note)
{
    const enum fault_place place = fault_place_of(note->kind);
    if (note->link != 0) json_uint(json, "link", note->link);
    if (note->session != 0) json_uint(json, "session", note->session);
    if (place == FAULT_AT_FRAME || place == FAULT_AT_REPLY) json_string(json, "of", of_names[note->of]);
    if (note->number != 0)
        json_uint(json,
                  place == FAULT_AT_REPLY        ? "reply"
                  : place == FAULT_AT_CONNECTION ? "connection"
                                                 : "frame",
                  note->number);
    if (note->has_seq) json_uint(json, "seq", note->seq);
    if (note->has_seq) json_uint(json, "type", note->type);
    if (note->has_pulse) json_uint(json, "pulse", note->pulse);
    if (note->byte >= 0) json_int(json, "byte", note->byte);
    if (note->byte >= 0 && note->kind == FAULT_FLIP) json_uint(json, "bit", note->bit);
}

void truth_write(struct truth *truth, const struct fault_note *note)
{
    struct json json;
    if (truth == NULL) return;
    pthread_mutex_lock(&truth->lock);
    rewind(truth->line);
    json_begin_one_line(&json, truth->line);
    json_open_object(&json, NULL);
    json_uint(&json, "fault", note->fault);
    json_string(&json, "kind", fault_names[note->kind]);
    json_int(&json, "t_ns", note->t_ns);
    put_place(&json, note);
    if (note->n != 0) json_uint(&json, "n", note->n);
    if (note->for_ms > 0.0) json_double(&json, "for_ms", note->for_ms);
    if (note->ended) json_bool(&json, "ended", 1);
    if (note->text[0] != '\0') json_string(&json, "text", note->text);
    json_close_object(&json);
    json_end(&json, NULL); /* a line has room for any note */
    line_writer_put(truth->lines, LINE_PLAIN, truth->text, (size_t)ftell(truth->line));
    pthread_mutex_unlock(&truth->lock);
}

int truth_is_filling(const struct truth *truth)
{
    return truth != NULL && line_writer_is_filling(truth->lines);
}

int truth_close(struct truth *truth, struct sh_err *err)
{
    if (truth == NULL) return SH_OK;
    const int rc = line_writer_close(truth->lines, NULL, err);
    fclose(truth->line);
    pthread_mutex_destroy(&truth->lock);
    free(truth);
    return rc;
}

__attribute__((format(printf, 2, 3))) static void add(char text[TRUTH_TEXT_LEN], const char *fmt, ...)
{
    const size_t len = strlen(text);
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text + len, TRUTH_TEXT_LEN - len, fmt, ap);
    va_end(ap);
}

void truth_text(const struct fault_note *note, char text[TRUTH_TEXT_LEN])
{
    text[0] = '\0';
    add(text, "fault %" PRIu32 " %s%s: t_ns %" PRId64, note->fault, fault_names[note->kind], note->ended ? " over" : "",
        note->t_ns);
    if (note->link != 0) add(text, ", link %" PRIu32, note->link);
    if (note->session != 0) add(text, ", session %" PRIu32, note->session);
    if (note->number != 0)
        add(text, ", %s %" PRIu64,
            fault_place_of(note->kind) == FAULT_AT_CONNECTION ? "connection" : of_names[note->of], note->number);
    if (note->has_seq) add(text, ", seq %" PRIu32, note->seq);
    if (note->has_pulse) add(text, ", pulse %" PRIu64, note->pulse);
    if (note->byte >= 0) add(text, ", byte %" PRId64, note->byte);
    if (note->n != 0) add(text, ", n %" PRIu64, note->n);
    if (note->for_ms > 0.0) add(text, ", for %g ms", note->for_ms);
    if (note->text[0] != '\0') add(text, ", %s", note->text);
}

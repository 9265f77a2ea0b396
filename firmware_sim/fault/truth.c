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

static const char *const of_names[] = {"stream", "notices", "replies"};

struct truth {
    pthread_mutex_t lock;
    FILE *file;
    const char *path; /* the caller's, or what to call it */
    int error;        /* errno of the first failure */
};

/* Of standard output a descriptor of its own: nobody else's lines are in its buffer. */
static int open_stdout(int *fd, struct sh_err *err)
{
    *fd = dup(STDOUT_FILENO);
    return *fd >= 0 ? SH_OK : sh_fail(err, SH_EIO, "standard output: %s", strerror(errno));
}

int truth_open(const char *path, struct truth **out, struct sh_err *err)
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
    FILE *file = truth != NULL ? fdopen(fd, "w") : NULL;
    if (file == NULL) {
        free(truth);
        close(fd);
        return sh_fail(err, SH_ENOMEM, "truth: %s: no memory", path);
    }
    *truth = (struct truth){.file = file, .path = path};
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
        json_uint(json, place == FAULT_AT_REPLY ? "reply" : place == FAULT_AT_CONNECTION ? "connection" : "frame",
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
    struct sh_err err;
    if (truth == NULL) return;
    pthread_mutex_lock(&truth->lock);
    json_begin_one_line(&json, truth->file);
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
    const int failed = json_end(&json, &err) != SH_OK || fflush(truth->file) != 0;
    if (failed && truth->error == 0) truth->error = errno != 0 ? errno : EIO;
    pthread_mutex_unlock(&truth->lock);
}

int truth_close(struct truth *truth, struct sh_err *err)
{
    if (truth == NULL) return SH_OK;
    int error = truth->error;
    if (fclose(truth->file) != 0 && error == 0) error = errno;
    const int rc = error == 0 ? SH_OK : sh_fail(err, SH_EIO, "truth: %s: %s", truth->path, strerror(error));
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
    add(text, "fault %" PRIu32 " %s%s: t_ns %" PRId64, note->fault, fault_names[note->kind],
        note->ended ? " over" : "", note->t_ns);
    if (note->link != 0) add(text, ", link %" PRIu32, note->link);
    if (note->session != 0) add(text, ", session %" PRIu32, note->session);
    if (note->number != 0) add(text, ", %s %" PRIu64, of_names[note->of], note->number);
    if (note->has_seq) add(text, ", seq %" PRIu32, note->seq);
    if (note->has_pulse) add(text, ", pulse %" PRIu64, note->pulse);
    if (note->byte >= 0) add(text, ", byte %" PRId64, note->byte);
    if (note->n != 0) add(text, ", n %" PRIu64, note->n);
    if (note->for_ms > 0.0) add(text, ", for %g ms", note->for_ms);
    if (note->text[0] != '\0') add(text, ", %s", note->text);
}

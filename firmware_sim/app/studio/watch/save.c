/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/watch/save.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/bytes.h"
#include "core/text.h"
#include "drivers/protocol/native_encode.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/page_query.h"
#include "firmware_sim/app/studio/record/job.h"
#include "firmware_sim/app/studio/watch/watch.h"
#include "firmware_sim/base/clock.h"

enum { AS_LEN = 9, FOLDER_LEN = 400, PATH_LEN = FOLDER_LEN + 32 };
enum save_state { SAVE_IDLE, SAVE_WORKING, SAVE_DONE, SAVE_FAILED };

/* A scan's end is waited for until nothing more has come for PATIENCE_NS. */
static const int64_t PATIENCE_NS = 10000000000, WAIT_NS = 5000000;

struct save {
    struct save_source source;
    pthread_t thread;
    int has_thread;          /* it was begun, and not joined */
    atomic_int ends;         /* no file is wanted any more */
    char folder[FOLDER_LEN]; /* empty: there is none yet */
    char stream[PATH_LEN], file[PATH_LEN];

    pthread_mutex_t lock;
    enum save_state state;
    char as[AS_LEN];
    uint64_t number; /* of the file, from 1 */
    uint64_t bytes;
    uint64_t gone, lost_frames; /* points that the file lacks; frames that the observer had lost */
    struct sh_err failure;
};

/* ---- the file */

static int save_ends(void *self)
{
    struct save *s = self;
    return atomic_load(&s->ends);
}

static int get_end(const struct save *s, uint64_t *end, struct sh_err *err)
{
    char query[32];
    struct web_body none;
    snprintf(query, sizeof query, "from=%.0f", PAST_MOST_POSITION);
    const int rc = past_get(s->source.past, query, &none, err);
    if (rc != SH_OK) return rc;
    *end = le_get64((const uint8_t *)none.bytes + 24);
    free(none.bytes);
    return SH_OK;
}

/* The observer reads the stream later than other clients do. One of them may have seen a scan's end, and then the file
 * is to have the whole scan. */
static int await_scan_end(struct save *s, struct sh_err *err)
{
    uint64_t end = 0, before = 0;
    int64_t news_ns = clock_now_ns();
    while (s->source.is_behind != NULL && s->source.is_behind(s->source.ctx) && !save_ends(s)) {
        const int rc = get_end(s, &end, err);
        if (rc != SH_OK) return rc;
        const int64_t now_ns = clock_now_ns();
        if (end != before) news_ns = now_ns;
        if (now_ns - news_ns > PATIENCE_NS) return SH_OK;
        before = end;
        clock_sleep_until_ns(now_ns + WAIT_NS);
    }
    return SH_OK;
}

/* Numbers the frames anew: the past keeps only some kinds, and the others are no loss. Frames that the observer lost
 * leave a gap, as they do in the stream that it read. */
struct renumber {
    uint32_t next;
    uint64_t lost;   /* in all, as READER_LOST says */
    uint64_t points; /* of the frames so far */
};

static void renumber(struct renumber *r, uint8_t *frames, size_t len)
{
    for (uint8_t *at = frames, *end = frames + len; at < end; at += native_frame_len(at)) {
        const uint8_t *payload = at + NATIVE_HEADER_LEN;
        const size_t payload_len = native_frame_len(at) - NATIVE_HEADER_LEN;
        struct native_header h;
        struct native_event event;
        struct native_points points;
        native_read_header(at, &h);
        if ((h.flags & NATIVE_LOCAL) == 0) {
            if (h.type == NATIVE_POINTS && native_decode_points(payload, payload_len, &points) == SH_OK)
                r->points += points.n_points;
            native_finish_frame(at, r->next++);
            continue;
        }
        if (h.type != NATIVE_EVENT || native_decode_event(payload, payload_len, &event) != SH_OK) continue;
        r->next += (uint32_t)(event.c - r->lost);
        r->lost = event.c;
    }
}

/* The past may have dropped pieces from `from` on since the frames before were read. A gap of one number stands for
 * their frames, which nobody has counted. All points that went are then older than this piece, and the file has some of
 * them. Points that go later may be in the file. */
static void note_missing(struct save *s, const struct web_body *piece, uint64_t from, struct renumber *numbers)
{
    const uint8_t *head = (const uint8_t *)piece->bytes;
    const uint64_t begin = le_get64(head + 16) - (piece->len - PAST_HEAD_LEN);
    const int is_first = from == 0, has_jumped = begin > from;
    if (has_jumped && !is_first) numbers->next++;
    pthread_mutex_lock(&s->lock);
    if (is_first || has_jumped) s->gone = le_get64(head + 32) - numbers->points;
    s->lost_frames = le_get64(head + 40);
    pthread_mutex_unlock(&s->lock);
}

/* Writes the frames that there are now. Frames that come meanwhile are left out, except in the last piece: it is read
 * with all frames that it has by then. */
static int write_frames(struct save *s, FILE *f, struct sh_err *err)
{
    char query[32] = "";
    struct renumber numbers = {0};
    for (uint64_t end = 0, next = 0;;) {
        struct web_body piece;
        if (save_ends(s)) return sh_fail(err, SH_ESTOPPED, "%s: stopped", s->stream);
        const int rc = past_get(s->source.past, query, &piece, err);
        if (rc != SH_OK) return rc;
        const uint8_t *head = (const uint8_t *)piece.bytes;
        const size_t len = piece.len - PAST_HEAD_LEN;
        note_missing(s, &piece, next, &numbers);
        next = le_get64(head + 16);
        if (end == 0) end = le_get64(head + 24);
        renumber(&numbers, (uint8_t *)piece.bytes + PAST_HEAD_LEN, len);
        const size_t written = fwrite(piece.bytes + PAST_HEAD_LEN, 1, len, f);
        free(piece.bytes);
        if (written != len) return sh_fail(err, SH_EIO, "%s: %s", s->stream, strerror(errno));
        if (next >= end) return SH_OK;
        snprintf(query, sizeof query, "from=%llu", (unsigned long long)next);
    }
}

static int write_stream(struct save *s, struct sh_err *err)
{
    FILE *f = fopen(s->stream, "wb");
    if (f == NULL) return sh_fail(err, SH_EIO, "%s: %s", s->stream, strerror(errno));
    int rc = write_frames(s, f, err);
    if (fclose(f) != 0 && rc == SH_OK) rc = sh_fail(err, SH_EIO, "%s: %s", s->stream, strerror(errno));
    return rc;
}

/* This stream may end in the middle of a scan. The recorder's warnings are not for those who run the head. */
static int write_file(struct save *s, struct sh_err *err)
{
    struct record_job *job = calloc(1, sizeof *job);
    if (job == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a file");
    job->source = s->stream;
    job->brief = job->silent = job->no_hash = job->may_end = 1;
    job->stop = save_ends;
    job->stop_ctx = s;
    job->recording.frames = -1;
    int rc = record_files_add(&job->files, s->file, err);
    if (rc == SH_OK) rc = record_job_stream(job, err);
    free(job);
    return rc;
}

/* A recorder that fails leaves parts, from which --repair could make a file. Nobody asks for a repair of a page's
 * file. */
static void empty_folder(const struct save *s)
{
    DIR *folder = s->folder[0] != '\0' ? opendir(s->folder) : NULL;
    if (folder == NULL) return;
    for (const struct dirent *entry; (entry = readdir(folder)) != NULL;)
        unlinkat(dirfd(folder), entry->d_name, 0);
    closedir(folder);
}

static void *make(void *self)
{
    struct save *s = self;
    struct sh_err err = {0};
    struct stat st = {0};
    setpriority(PRIO_PROCESS, (id_t)gettid(), WATCH_NICE);
    int rc = await_scan_end(s, &err);
    if (rc == SH_OK) rc = write_stream(s, &err);
    if (rc == SH_OK) rc = write_file(s, &err);
    if (rc == SH_OK && stat(s->file, &st) != 0) rc = sh_fail(&err, SH_EIO, "%s: %s", s->file, strerror(errno));
    if (rc == SH_OK)
        unlink(s->stream);
    else
        empty_folder(s);
    pthread_mutex_lock(&s->lock);
    s->state = rc == SH_OK ? SAVE_DONE : SAVE_FAILED;
    s->bytes = (uint64_t)st.st_size;
    s->failure = err;
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

static void save_join(struct save *s)
{
    if (s->has_thread) pthread_join(s->thread, NULL);
    s->has_thread = 0;
}

/* ---- asking */

static void put_state(struct json *json, const void *ctx)
{
    static const char *const words[] = {"idle", "working", "done"};
    const struct save *s = ctx;
    json_open_object(json, NULL);
    json_string(json, "state", words[s->state]);
    json_string(json, "as", s->as);
    json_uint(json, "file", s->number);
    json_uint(json, "bytes", s->state == SAVE_DONE ? s->bytes : 0);
    json_uint(json, "gone", s->gone);
    json_uint(json, "lost_frames", s->lost_frames);
    json_close_object(json);
}

/* Allows the formats of points that need no second file. */
static int check_as(const char *as, struct sh_err *err)
{
    static const char *const all[] = {"las", "ply", "e57", "ptx", "pcapng", NULL};
    if (text_is_one_of((struct text_span){as, strlen(as)}, all)) return SH_OK;
    return sh_fail(err, SH_EINPUT, "as=%.32s: allowed are las, ply, e57, ptx, pcapng", as);
}

static int begin_thread(struct save *s, const char *as, struct sh_err *err)
{
    const int is_there = s->folder[0] != '\0' && access(s->folder, W_OK) == 0; /* else a service may have removed it */
    if (!is_there && app_make_folder("save", s->folder, sizeof s->folder, err) != SH_OK) return SH_EIO;
    s->number++;
    snprintf(s->as, sizeof s->as, "%s", as);
    snprintf(s->stream, sizeof s->stream, "%s/stream.shs", s->folder);
    snprintf(s->file, sizeof s->file, "%s/points.%s", s->folder, as);
    s->has_thread = pthread_create(&s->thread, NULL, make, s) == 0;
    return s->has_thread ? SH_OK : sh_fail(err, SH_EIO, "no thread for a file");
}

/* The caller holds the lock. */
static int begin(struct save *s, const char *as, struct sh_err *err)
{
    if (s->state == SAVE_WORKING) return sh_fail(err, SH_EINPUT, "a file is being made (%s); ask again later", s->as);
    int rc = check_as(as, err);
    if (rc != SH_OK) return rc;
    save_join(s);
    empty_folder(s);
    s->gone = s->lost_frames = 0;
    rc = begin_thread(s, as, err);
    s->state = rc == SH_OK ? SAVE_WORKING : SAVE_FAILED;
    if (rc != SH_OK) s->failure = *err;
    return rc;
}

int save_get(struct save *s, const char *query, struct web_body *out, struct sh_err *err)
{
    int rc = SH_OK;
    pthread_mutex_lock(&s->lock);
    if (strncmp(query, "as=", 3) == 0)
        rc = begin(s, query + 3, err);
    else if (query[0] != '\0')
        rc = sh_fail(err, SH_EINPUT, "%.64s: allowed is as=ENDING, or nothing", query);
    else if (s->state == SAVE_FAILED)
        rc = sh_fail(err, s->failure.code, "%s", s->failure.text); /* to each page that asks */
    if (rc == SH_OK) rc = page_json(put_state, s, out, err);
    pthread_mutex_unlock(&s->lock);
    return rc;
}

static int read_piece(const char *path, uint64_t from, struct web_body *out, struct sh_err *err)
{
    FILE *f = fopen(path, "rb");
    *out = (struct web_body){"application/octet-stream", malloc(SAVE_PIECE), 0};
    int rc = f != NULL && out->bytes != NULL ? SH_OK : sh_fail(err, SH_EIO, "%s: %s", path, strerror(errno));
    if (rc == SH_OK && fseek(f, (long)from, SEEK_SET) == 0) out->len = fread(out->bytes, 1, SAVE_PIECE, f);
    if (rc == SH_OK && ferror(f)) rc = sh_fail(err, SH_EIO, "%s: %s", path, strerror(errno));
    if (f != NULL) fclose(f);
    if (rc != SH_OK) free(out->bytes);
    return rc;
}

int save_get_piece(struct save *s, const char *query, struct web_body *out, struct sh_err *err)
{
    struct page_word words[] = {
        {"file", 1, 1e9, 1, (double)NAN}, {"from", 0, PAST_MOST_POSITION, 1, 0}, {.name = NULL}};
    int rc = page_read_query(words, query, err);
    if (rc != SH_OK) return rc;
    const uint64_t number = (uint64_t)words[0].value;
    pthread_mutex_lock(&s->lock);
    if (number != s->number || s->state != SAVE_DONE)
        rc = sh_fail(err, SH_EINPUT, "file %" PRIu64 " is not there; /save has the number of the last one", number);
    else
        rc = read_piece(s->file, (uint64_t)words[1].value, out, err);
    pthread_mutex_unlock(&s->lock);
    return rc;
}

/* ---- life */

struct save *save_create(const struct save_source *source)
{
    struct save *s = calloc(1, sizeof *s);
    if (s == NULL) return NULL;
    s->source = *source;
    pthread_mutex_init(&s->lock, NULL);
    return s;
}

void save_free(struct save *s)
{
    if (s == NULL) return;
    atomic_store(&s->ends, 1);
    save_join(s);
    empty_folder(s);
    if (s->folder[0] != '\0') rmdir(s->folder);
    pthread_mutex_destroy(&s->lock);
    free(s);
}

/* SPDX-License-Identifier: MIT */
#include "firmware_sim/base/line_writer.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "firmware_sim/base/clock.h"

/* A pipe takes pieces of up to PIPE_BUF bytes whole or not at all, so it never has half a line. */
enum { PIECE = 4096, STACK_BYTES = 256 * 1024 };
static const int64_t PATIENCE_NS = 2000000000; /* at the end, links wait for their readers equally long (DRAIN_NS) */

struct line_head {
    uint16_t len;
    uint16_t kind;
};

/* Bytes that the writing thread has taken out of the queue. */
struct piece {
    char text[PIECE];
    size_t len;
    uint64_t lines;
};

struct line_writer {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    struct line_writer_spec spec;
    char *queue; /* ring of spec.room bytes: a head, a line, a head ... */
    size_t first;
    _Atomic size_t used;
    uint64_t waiting;          /* lines in the queue, and in the piece that is being written */
    uint64_t gap[LINE_KINDS];  /* lines dropped that the file does not report yet */
    uint64_t pieces;           /* written so far, or given up after an error */
    _Atomic uint64_t own_lost; /* the count where the caller gave none */
    _Atomic int error;         /* errno of the first failure */
    char last[LINE_MOST_BYTES];
    int closing, done, abandoned;
    pthread_t thread;
};

/* ---- the queue, with the lock held */

static void copy_in(struct line_writer *w, size_t at, const void *from, size_t len)
{
    const size_t begin = (w->first + at) % w->spec.room, to_end = w->spec.room - begin;
    const size_t n = len < to_end ? len : to_end;
    memcpy(w->queue + begin, from, n);
    memcpy(w->queue, (const char *)from + n, len - n);
}

static void copy_out(const struct line_writer *w, size_t at, void *to, size_t len)
{
    const size_t begin = (w->first + at) % w->spec.room, to_end = w->spec.room - begin;
    const size_t n = len < to_end ? len : to_end;
    memcpy(to, w->queue + begin, n);
    memcpy((char *)to + n, w->queue, len - n);
}

static void append(struct line_writer *w, enum line_kind kind, const char *text, size_t len)
{
    const struct line_head head = {(uint16_t)len, (uint16_t)kind};
    copy_in(w, w->used, &head, sizeof head);
    copy_in(w, w->used + sizeof head, text, len);
    w->used += sizeof head + len;
    w->waiting++;
}

static int has_gap(const struct line_writer *w)
{
    return w->gap[LINE_PLAIN] != 0 || w->gap[LINE_REMARK] != 0;
}

/* Makes the line that stands for the dropped lines, and forgets their number. Callers ask has_gap() first. */
static size_t take_gap(struct line_writer *w, char text[LINE_GAP_BYTES])
{
    w->spec.gap(text, w->gap);
    memset(w->gap, 0, sizeof w->gap);
    return strlen(text);
}

static void drop(struct line_writer *w, enum line_kind kind)
{
    w->gap[kind]++;
    atomic_fetch_add(w->spec.lost, 1);
}

/* ---- the thread */

/* Takes whole lines out of the queue; a gap goes after the last one. */
static void take_piece(struct line_writer *w, struct piece *piece)
{
    struct line_head head;
    *piece = (struct piece){.len = 0};
    while (w->used != 0) {
        copy_out(w, 0, &head, sizeof head);
        if (piece->len + head.len > PIECE) return;
        copy_out(w, sizeof head, piece->text + piece->len, head.len);
        w->first = (w->first + sizeof head + head.len) % w->spec.room;
        w->used -= sizeof head + head.len;
        piece->len += head.len;
        piece->lines++;
    }
    if (w->error != 0 || !has_gap(w) || piece->len + LINE_GAP_BYTES > PIECE) return;
    char text[LINE_GAP_BYTES];
    const size_t len = take_gap(w, text);
    memcpy(piece->text + piece->len, text, len);
    piece->len += len;
}

/* Returns 0, or the errno of the write that failed. If another program has made the descriptor non-blocking, the
 * function waits until the descriptor takes bytes again. */
static int write_piece(int fd, const struct piece *piece)
{
    struct pollfd slot = {.fd = fd, .events = POLLOUT};
    for (size_t at = 0; at < piece->len;) {
        const ssize_t n = write(fd, piece->text + at, piece->len - at);
        if (n < 0 && errno == EAGAIN)
            poll(&slot, 1, -1);
        else if (n < 0 && errno != EINTR)
            return errno;
        if (n > 0) at += (size_t)n;
    }
    return 0;
}

/* Waits for lines and takes a piece. 0: everything is written, and no more lines come. */
static int wait_for_piece(struct line_writer *w, struct piece *piece)
{
    while (w->used == 0 && (w->error != 0 || !has_gap(w)) && !w->closing)
        pthread_cond_wait(&w->changed, &w->lock);
    take_piece(w, piece);
    if (piece->len != 0) return 1;
    piece->len = strlen(w->last);
    piece->lines = piece->len != 0;
    memcpy(piece->text, w->last, piece->len);
    w->last[0] = '\0';
    return piece->len != 0;
}

static void release(struct line_writer *w)
{
    pthread_mutex_destroy(&w->lock);
    pthread_cond_destroy(&w->changed);
    free(w->queue);
    free(w);
}

static void *writer_main(void *arg)
{
    struct line_writer *w = arg;
    struct piece piece;
    pthread_mutex_lock(&w->lock);
    while (!w->abandoned && wait_for_piece(w, &piece)) {
        int error = w->error;
        pthread_mutex_unlock(&w->lock);
        if (error == 0) error = write_piece(w->spec.fd, &piece);
        pthread_mutex_lock(&w->lock);
        if (w->abandoned) break;
        w->waiting -= piece.lines;
        w->pieces++;
        if (error != 0) atomic_fetch_add(w->spec.lost, piece.lines);
        if (w->error == 0) w->error = error;
        pthread_cond_broadcast(&w->changed);
    }
    w->done = 1;
    const int is_mine = w->abandoned;
    pthread_cond_broadcast(&w->changed);
    pthread_mutex_unlock(&w->lock);
    if (is_mine) close(w->spec.fd);
    if (is_mine) release(w);
    return NULL;
}

/* The stack is small, since all memory that a head has when it begins is locked. */
static int start_thread(struct line_writer *w)
{
    pthread_attr_t attr;
    pthread_attr_init(&attr);
    pthread_attr_setstacksize(&attr, STACK_BYTES);
    const int rc = pthread_create(&w->thread, &attr, writer_main, w);
    pthread_attr_destroy(&attr);
    return rc;
}

/* ---- the interface */

int line_writer_open(const struct line_writer_spec *spec, struct line_writer **out, struct sh_err *err)
{
    struct line_writer *w = calloc(1, sizeof *w);
    *out = NULL;
    if (w != NULL) w->queue = malloc(spec->room);
    if (w == NULL || w->queue == NULL) {
        free(w);
        close(spec->fd);
        return sh_fail(err, SH_ENOMEM, "%s: %s: no memory", spec->what, spec->path);
    }
    w->spec = *spec;
    if (w->spec.lost == NULL) w->spec.lost = &w->own_lost;
    pthread_condattr_t attr;
    pthread_condattr_init(&attr);
    pthread_condattr_setclock(&attr, CLOCK_MONOTONIC);
    pthread_cond_init(&w->changed, &attr);
    pthread_condattr_destroy(&attr);
    pthread_mutex_init(&w->lock, NULL);
    const int failed = start_thread(w);
    if (failed != 0) {
        close(spec->fd);
        release(w);
        return sh_fail(err, SH_EIO, "%s: %s: no thread: %s", spec->what, spec->path, strerror(failed));
    }
    *out = w;
    return SH_OK;
}

int line_writer_put(struct line_writer *w, enum line_kind kind, const char *text, size_t len)
{
    int rc = SH_OK;
    pthread_mutex_lock(&w->lock);
    const size_t room = kind == LINE_REMARK ? w->spec.room / 2 : w->spec.room;
    const size_t gap = has_gap(w) ? LINE_GAP_BYTES + sizeof(struct line_head) : 0;
    if (w->error != 0) {
        rc = SH_EIO;
    } else if (len > LINE_MOST_BYTES || w->used + gap + len + sizeof(struct line_head) > room) {
        rc = SH_ELOST;
    } else if (gap != 0) {
        char both[LINE_GAP_BYTES + LINE_MOST_BYTES]; /* counted as one line */
        const size_t n = take_gap(w, both);
        memcpy(both + n, text, len);
        append(w, kind, both, n + len);
    } else {
        append(w, kind, text, len);
    }
    if (rc != SH_OK) drop(w, kind);
    pthread_cond_broadcast(&w->changed);
    pthread_mutex_unlock(&w->lock);
    return rc;
}

int line_writer_is_filling(const struct line_writer *w)
{
    return w != NULL && w->used > w->spec.room / 4 && w->error == 0;
}

/* Waits until all is written, or the file has taken nothing for PATIENCE_NS. */
static void wait_for_end(struct line_writer *w)
{
    while (!w->done) {
        const uint64_t before = w->pieces;
        const int64_t until_ns = clock_now_ns() + PATIENCE_NS;
        const struct timespec until = {.tv_sec = until_ns / 1000000000, .tv_nsec = until_ns % 1000000000};
        while (!w->done && w->pieces == before)
            if (pthread_cond_timedwait(&w->changed, &w->lock, &until) == ETIMEDOUT && w->pieces == before) return;
    }
}

int line_writer_close(struct line_writer *w, const char *last, struct sh_err *err)
{
    if (w == NULL) return SH_OK;
    const struct line_writer_spec spec = w->spec;
    pthread_mutex_lock(&w->lock);
    if (last != NULL) strncpy(w->last, last, sizeof w->last - 1);
    w->closing = 1;
    pthread_cond_broadcast(&w->changed);
    wait_for_end(w);
    int error = w->error;
    const int is_stuck = w->abandoned = !w->done;
    if (is_stuck) atomic_fetch_add(spec.lost, w->waiting + (w->last[0] != '\0'));
    const uint64_t lost = atomic_load(spec.lost);
    const pthread_t thread = w->thread;
    pthread_mutex_unlock(&w->lock);
    if (is_stuck) {
        pthread_detach(thread); /* it can't be woken from its write; it frees the writer if that write ever ends */
        return sh_fail(err, SH_EIO, "%s: %s: its reader took no data for %d s; %llu lines are missing", spec.what,
                       spec.path, (int)(PATIENCE_NS / 1000000000), (unsigned long long)lost);
    }
    pthread_join(thread, NULL);
    if (close(spec.fd) != 0 && error == 0) error = errno;
    release(w);
    if (error == 0) return SH_OK;
    return sh_fail(err, SH_EIO, "%s: %s: %s; %llu lines are missing", spec.what, spec.path, strerror(error),
                   (unsigned long long)lost);
}

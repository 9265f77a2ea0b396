/* SPDX-License-Identifier: MIT */
/* Requests that wait, answers that are kept, and the thread that does the work.
 *
 *     free --asked--> waiting --taken--> working --> done --asked--> its body, again and again
 *
 * A request is known by its text. A request for a place stops the search for a next station, which takes longer. The
 * search begins again afterwards, so that a dragged station does not wait for it. The newest request is worked on
 * first: while a station is dragged, older ones are about places that it has left. A search that waited while
 * MOST_PASSED others were worked on is due: it is the next one, and no place stops it. Else a page that drags all the
 * time would keep the search from ending. A request that nobody asked for lately gives its slot away, and so do the
 * oldest answers, except those that a search names. */
#include "firmware_sim/app/studio/preview/preview.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "core/bytes.h"
#include "firmware_sim/app/studio/preview/inside.h"
#include "firmware_sim/base/clock.h"

enum { JOBS = 64, MOST_BYTES = 96 << 20, MOST_PASSED = 6 };
static const double BLIND_CELL_M = 1e3, BLIND_MIB = 4096.0;
static const int64_t FORGOTTEN_NS = 2000000000; /* a page that waits asks again far sooner */
static const int64_t LATELY_NS = 500000000;     /* a page asks again after 0.2 s at most; requests take time, too */

enum job_state { JOB_FREE, JOB_WAITING, JOB_WORKING, JOB_DONE };

/* An answer is freed once neither its job nor a reader has it. */
struct answer {
    struct answer *next;
    struct web_body body;
    int holders;
};

struct job {
    enum job_state state;
    char *text; /* path?query */
    struct preview_request request;
    uint32_t number; /* from 1, never used again */
    int64_t asked_ns;
    int passed;            /* how many others were worked on while this one waited */
    struct answer *answer; /* NULL: none, or a refusal */
    int rc;
    struct sh_err err;
};

struct preview {
    struct preview_options options;
    struct sites sites;
    struct preview_work work;
    struct coverage *blind; /* without cells; used where the options have no coverage */
    struct sh_err why;      /* why `blind` could not be made */
    /* ending: all work stops. gives_way: the present work stops for a place. is_place_asked: a place was asked for. */
    atomic_int ending, gives_way, is_place_asked;
    pthread_t thread;
    int running;
    pthread_mutex_t lock;
    pthread_cond_t wake;
    struct job job[JOBS];
    uint32_t numbers;
    struct answer *answers;
    size_t bytes; /* of those that jobs have */
};

/* ---- slots; the lock is held */

static void let_go(struct preview *p, struct answer *answer)
{
    struct answer **at = &p->answers;
    if (--answer->holders > 0) return;
    while (*at != answer)
        at = &(*at)->next;
    *at = answer->next;
    free(answer->body.bytes);
    free(answer);
}

static void forget_job(struct preview *p, struct job *job)
{
    if (job->answer != NULL) {
        p->bytes -= job->answer->body.len;
        let_go(p, job->answer);
    }
    free(job->text);
    *job = (struct job){.state = JOB_FREE};
}

static struct job *find_job(struct preview *p, const char *text)
{
    for (int i = 0; i < JOBS; i++)
        if (p->job[i].state != JOB_FREE && strcmp(p->job[i].text, text) == 0) return &p->job[i];
    return NULL;
}

static int is_search(const struct job *job)
{
    return job->request.kind == PREVIEW_NEXT || job->request.kind == PREVIEW_REACH;
}

static int is_asked_within(const struct job *job, int64_t ns)
{
    return clock_now_ns() - job->asked_ns <= ns;
}

/* Whether a search that has no answer yet needs the preview with this number. */
static int is_named(const struct preview *p, uint32_t number)
{
    for (int i = 0; i < JOBS; i++) {
        const struct job *job = &p->job[i];
        const int waits = job->state == JOB_WAITING && is_asked_within(job, FORGOTTEN_NS);
        if (!is_search(job) || !(waits || job->state == JOB_WORKING)) continue;
        for (uint32_t k = 0; k < job->request.n_named; k++)
            if (job->request.named[k] == number) return 1;
    }
    return 0;
}

/* Returns the job of a state that was asked for longest ago; NULL: there is none. Answers that a search names do not
 * count. */
static struct job *oldest_of(struct preview *p, enum job_state state)
{
    struct job *oldest = NULL;
    for (int i = 0; i < JOBS; i++) {
        struct job *job = &p->job[i];
        if (job->state != state || (oldest != NULL && job->asked_ns >= oldest->asked_ns)) continue;
        if (state != JOB_DONE || !is_named(p, job->number)) oldest = job;
    }
    return oldest;
}

static struct job *free_slot(struct preview *p)
{
    struct job *job = oldest_of(p, JOB_FREE);
    if (job == NULL) {
        job = oldest_of(p, JOB_WAITING);
        if (job != NULL && is_asked_within(job, FORGOTTEN_NS)) job = NULL;
    }
    if (job == NULL) job = oldest_of(p, JOB_DONE);
    if (job != NULL && job->state != JOB_FREE) forget_job(p, job);
    return job;
}

/* Whether a search has let enough places pass. A search that its page has left is never due. */
static int is_due(const struct job *job)
{
    return is_search(job) && job->passed >= MOST_PASSED && is_asked_within(job, LATELY_NS);
}

/* Returns a search that is due, else the newest job that waits; NULL: none waits. */
static struct job *next_waiting(struct preview *p)
{
    struct job *next = NULL;
    for (int i = 0; i < JOBS; i++) {
        struct job *job = &p->job[i];
        if (job->state != JOB_WAITING) continue;
        if (is_due(job)) return job;
        if (next == NULL || job->number > next->number) next = job;
    }
    return next;
}

/* ---- the work */

static int must_stop(void *ctx)
{
    const struct preview *p = ctx;
    return atomic_load_explicit(&p->ending, memory_order_relaxed) ||
           (atomic_load_explicit(&p->gives_way, memory_order_relaxed) &&
            atomic_load_explicit(&p->is_place_asked, memory_order_relaxed));
}

/* Copies what a preview saw out of its answer. The lock is held. */
static int copy_seen(struct preview *p, uint32_t number, struct preview_seen *seen, struct sh_err *err)
{
    const size_t words = preview_words(p->work.coverage);
    seen->cells = malloc((words + 1) * sizeof *seen->cells);
    if (seen->cells == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a suggestion");
    for (int i = 0; i < JOBS; i++) {
        const struct job *job = &p->job[i];
        if (job->number != number || job->state != JOB_DONE || job->rc != SH_OK || job->request.kind != PREVIEW_PLACE)
            continue;
        const char *bytes = job->answer->body.bytes;
        for (size_t k = 0; k < words; k++)
            seen->cells[k] = le_get64(bytes + PREVIEW_CELLS_AT + 8 * k);
        seen->hits = le_get32(bytes + PREVIEW_HITS_AT);
        seen->front = le_get32(bytes + PREVIEW_FRONT_AT);
        return SH_OK;
    }
    return sh_fail(err, SH_EINPUT, "preview %u is kept no more; ask for its place again", number);
}

/* Answers from the cells of earlier previews. */
static int suggest(struct preview *p, const struct preview_request *request, struct web_body *out, struct sh_err *err)
{
    struct preview_seen seen[PREVIEW_MOST_OF] = {{.cells = NULL}};
    int rc = SH_OK;
    pthread_mutex_lock(&p->lock);
    for (uint32_t i = 0; i < request->n_named && rc == SH_OK; i++)
        rc = copy_seen(p, request->named[i], &seen[i], err);
    pthread_mutex_unlock(&p->lock);
    if (rc == SH_OK)
        rc = request->kind == PREVIEW_NEXT ? preview_next(&p->work, request, seen, out, err)
                                           : preview_reach(&p->work, request, seen, out, err);
    for (uint32_t i = 0; i < request->n_named; i++)
        free(seen[i].cells);
    return rc;
}

static int work_on(struct preview *p, const struct preview_request *request, uint32_t number, struct web_body *out,
                   struct sh_err *err)
{
    if (p->work.coverage == NULL) return sh_fail(err, p->why.code, "%s", p->why.text);
    if (request->kind == PREVIEW_NEXT || request->kind == PREVIEW_REACH) return suggest(p, request, out, err);
    if (request->kind == PREVIEW_CELLS) return preview_cells(&p->work, out, err);
    return preview_look(&p->work, request, number, out, err);
}

/* The lock is held before and after, and not meanwhile. A job that is worked on keeps its slot. */
static void preview_do(struct preview *p, struct job *job)
{
    struct web_body body = {NULL, NULL, 0};
    struct sh_err err = {0, ""};
    job->state = JOB_WORKING;
    atomic_store(&p->is_place_asked, 0);
    atomic_store(&p->gives_way, is_search(job) && !is_due(job));
    for (int i = 0; i < JOBS; i++)
        p->job[i].passed += p->job[i].state == JOB_WAITING;
    pthread_mutex_unlock(&p->lock);
    int rc = work_on(p, &job->request, job->number, &body, &err);
    struct answer *answer = rc == SH_OK ? malloc(sizeof *answer) : NULL;
    if (rc == SH_OK && answer == NULL) rc = sh_fail(&err, SH_ENOMEM, "no memory for a preview");
    if (rc != SH_OK) free(body.bytes);
    pthread_mutex_lock(&p->lock);
    job->state = rc == SH_ESTOPPED ? JOB_WAITING : JOB_DONE;
    if (job->state == JOB_WAITING) return;
    job->rc = rc;
    job->err = err;
    if (rc != SH_OK) return;
    *answer = (struct answer){p->answers, body, 1};
    p->answers = job->answer = answer;
    p->bytes += body.len;
    while (p->bytes > MOST_BYTES) {
        struct job *old = oldest_of(p, JOB_DONE);
        if (old == NULL || old == job) break;
        forget_job(p, old);
    }
}

/* Makes a coverage whose surfaces give no cells: 4 bytes a triangle. */
static int make_blind(struct preview *p, struct sh_err *err)
{
    uint8_t *silent = malloc(SCENE_MAX_SURFACES + 1);
    if (silent == NULL) return sh_fail(err, SH_ENOMEM, "no memory for previews");
    memset(silent, 1, SCENE_MAX_SURFACES + 1);
    const struct coverage_spec spec = {
        .bvh = p->options.site->bvh, .silent = silent, .cell_m = BLIND_CELL_M, .memory_mib = BLIND_MIB, .threads = 1};
    const int rc = coverage_create(&spec, &p->work.stop, &p->blind, err);
    free(silent);
    return rc;
}

static void *preview_run(void *ctx)
{
    struct preview *p = ctx;
    setpriority(PRIO_PROCESS, (id_t)gettid(), p->options.nice);
    if (p->work.coverage == NULL && make_blind(p, &p->why) == SH_OK) p->work.coverage = p->blind;
    pthread_mutex_lock(&p->lock);
    while (!atomic_load(&p->ending)) {
        struct job *job = next_waiting(p);
        if (job == NULL)
            pthread_cond_wait(&p->wake, &p->lock);
        else if (!is_asked_within(job, FORGOTTEN_NS))
            forget_job(p, job);
        else
            preview_do(p, job);
    }
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

/* ---- asked by the page */

static int add_job(struct preview *p, char *text, const struct preview_request *request, struct job **out,
                   struct sh_err *err)
{
    struct job *job = *out = free_slot(p);
    if (!p->running) p->running = pthread_create(&p->thread, NULL, preview_run, p) == 0;
    if (job == NULL || !p->running) {
        free(text);
        return sh_fail(err, SH_ESTATE,
                       job == NULL ? "too many previews wait already; ask again" : "no thread for previews");
    }
    if (request->kind == PREVIEW_PLACE) atomic_store(&p->is_place_asked, 1);
    *job = (struct job){.state = JOB_WAITING, .text = text, .request = *request, .number = ++p->numbers};
    pthread_cond_signal(&p->wake);
    return SH_OK;
}

/* Readers share the bytes of an answer, without copies: an answer may have megabytes, and readers may be slow. */
static int lend(struct job *job, struct web_body *out, struct sh_err *err)
{
    const int is_done = job->state == JOB_DONE;
    if (is_done && job->rc != SH_OK) return sh_fail(err, job->rc, "%s", job->err.text);
    *out = is_done ? job->answer->body : (struct web_body){"application/octet-stream", NULL, 0};
    if (is_done) job->answer->holders++;
    return SH_OK;
}

void preview_release(struct preview *p, char *bytes)
{
    pthread_mutex_lock(&p->lock);
    struct answer *answer = p->answers;
    while (answer != NULL && answer->body.bytes != bytes)
        answer = answer->next;
    if (answer != NULL) let_go(p, answer);
    pthread_mutex_unlock(&p->lock);
    if (answer == NULL) free(bytes);
}

int preview_get(struct preview *p, const char *path, const char *query, struct web_body *out, struct sh_err *err)
{
    struct preview_request request;
    int rc = preview_read_request(&p->options, path, query, &request, err);
    if (rc != SH_OK) return rc;
    const size_t len = strlen(path) + strlen(query) + 2;
    char *text = malloc(len);
    if (text == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a request");
    snprintf(text, len, "%s?%s", path, query);
    pthread_mutex_lock(&p->lock);
    struct job *job = find_job(p, text);
    if (job != NULL)
        free(text);
    else
        rc = add_job(p, text, &request, &job, err);
    if (rc == SH_OK) {
        job->asked_ns = clock_now_ns();
        rc = lend(job, out, err);
    }
    pthread_mutex_unlock(&p->lock);
    return rc;
}

/* ---- as a whole */

int preview_create(const struct preview_options *options, struct preview **out, struct sh_err *err)
{
    struct preview *p = *out = calloc(1, sizeof *p);
    struct sh_err why = {0, ""};
    struct sh_report quiet = {0};
    if (p == NULL) return sh_fail(err, SH_ENOMEM, "no memory for previews");
    p->options = *options;
    atomic_init(&p->ending, 0);
    atomic_init(&p->gives_way, 0);
    atomic_init(&p->is_place_asked, 0);
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->wake, NULL);
    if (options->report != NULL) quiet = *options->report;
    quiet.warn = NULL; /* no warnings about scanners that this run does not serve */
    int rc = sites_load_beside(options->cfg, options->site, &quiet, &p->sites, &why);
    p->work = (struct preview_work){.options = &p->options,
                                    .coverage = options->coverage,
                                    .sites = &p->sites,
                                    .stop = {.ctx = p, .stop = must_stop}};
    if (rc == SH_OK) return SH_OK;
    if (rc == SH_EINPUT) {
        sh_warn(options->report, "the page previews the scanner of this run alone: %s", why.text);
        return SH_OK;
    }
    preview_free(p);
    *out = NULL;
    return sh_fail(err, rc, "%s", why.text);
}

void preview_free(struct preview *p)
{
    if (p == NULL) return;
    pthread_mutex_lock(&p->lock);
    atomic_store(&p->ending, 1);
    pthread_cond_signal(&p->wake);
    pthread_mutex_unlock(&p->lock);
    if (p->running) pthread_join(p->thread, NULL);
    for (int i = 0; i < JOBS; i++)
        forget_job(p, &p->job[i]);
    coverage_free(p->blind);
    sites_free(&p->sites);
    pthread_cond_destroy(&p->wake);
    pthread_mutex_destroy(&p->lock);
    free(p);
}

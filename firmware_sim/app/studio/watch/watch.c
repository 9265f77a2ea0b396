/* SPDX-License-Identifier: MIT */
/* The watch as a whole: opens, starts and closes it, and answers requests. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/record/offline.h"
#include "firmware_sim/app/studio/watch/inside.h"
#include "firmware_sim/config/config.h"

static int get(void *ctx, const char *path, const char *query, struct web_body *out, struct sh_err *err)
{
    struct watch *w = ctx;
    if (strcmp(path, "/past") == 0) return past_get(w->past, query, out, err);
    if (strcmp(path, "/save") == 0) return save_get(w->save, query, out, err);
    if (strcmp(path, "/saved") == 0) return save_get_piece(w->save, query, out, err);
    if (strcmp(path, "/quality") == 0) return watch_get_quality(w, out, err);
    if (strcmp(path, "/scene") == 0) return watch_get_scene(w, out, err);
    if (strcmp(path, "/head") == 0) return page_json(watch_put_head, w, out, err);
    if (strcmp(path, "/plan") == 0) return page_json(watch_put_plan, w, out, err);
    return w->preview != NULL ? preview_get(w->preview, path, query, out, err) : SH_EINPUT;
}

/* Previews are lent; all else is a copy. */
static void release(void *ctx, char *bytes)
{
    struct watch *w = ctx;
    if (w->preview != NULL)
        preview_release(w->preview, bytes);
    else
        free(bytes);
}

static int watch_make_room(struct watch *w, struct sh_err *err)
{
    const uint32_t n = w->site->n_stations;
    w->head = calloc(n, sizeof *w->head);
    w->shown_station = calloc(n, sizeof *w->shown_station);
    for (uint32_t i = 0; i < n && w->head != NULL; i++)
        if (config_serves(w->cfg, i)) report_head_of(w->site, i, &w->head[i]);
    const struct past_limits limits = {PAST_MOST_POINTS, PAST_MOST_BYTES};
    w->past = past_create(&limits);
    w->save = w->past != NULL ? save_create(&(struct save_source){w->past, watch_is_behind, w}) : NULL;
    if (w->head != NULL && w->shown_station != NULL && w->save != NULL) return SH_OK;
    return sh_fail(err, SH_ENOMEM, "no memory for %u stations", n);
}

static void close_watch(struct watch *w)
{
    atomic_store(&w->ending, 1);
    if (w->fd >= 0) shutdown(w->fd, SHUT_RDWR);
    if (w->running) pthread_join(w->thread, NULL);
    preview_free(w->preview);
    scanhead_close(w->sh);
    if (w->link.fd >= 0 && !w->link_given) close(w->link.fd);
    watch_sample_close(w);
    watch_seen_close(&w->seen);
    save_free(w->save);
    past_free(w->past);
    free(w->head);
    free(w->shown_station);
    free(w->scene_bytes);
    pthread_mutex_destroy(&w->lock);
    free(w);
}

/* Stations that can be moved can be tried at other places. */
static int open_preview(struct watch *w, struct sh_err *err)
{
    const struct preview_options options = {.cfg = w->cfg,
                                            .site = w->site,
                                            .coverage = w->seen.coverage,
                                            .cell_m = w->seen.cell_m,
                                            .nice = WATCH_NICE,
                                            .report = w->options.report};
    if (site_why_fixed(w->site) != NULL) return SH_OK;
    return preview_create(&options, &w->preview, err);
}

static int open_watch(const struct config *cfg, const struct site *site, const struct watch_options *options,
                      struct watch **out, struct sh_err *err)
{
    struct watch *w = *out = calloc(1, sizeof *w);
    if (w == NULL) return sh_fail(err, SH_ENOMEM, "no memory for what a page is told");
    w->cfg = cfg;
    w->site = site;
    w->options = *options;
    w->source = (struct web_source){w, get, release};
    w->fd = w->link.fd = -1;
    atomic_init(&w->ending, 0);
    atomic_init(&w->ended, 0);
    atomic_init(&w->is_deaf, 0);
    pthread_mutex_init(&w->lock, NULL);
    int rc = watch_make_room(w, err);
    if (rc == SH_OK) rc = watch_make_scene(w, err);
    if (rc == SH_OK) rc = watch_sample_open(w, err);
    if (rc == SH_OK) rc = watch_seen_open(w, err);
    if (rc == SH_OK) rc = open_preview(w, err);
    w->link.waits = options->waits ? LINK_WAITS_YES : LINK_WAITS_NO;
    if (rc == SH_OK) w->fd = offline_connect("the page's observer", &w->link, &w->sh, err);
    if (rc == SH_OK && w->fd < 0) rc = w->fd;
    w->shown_share = w->seen.coverage != NULL ? 0.0 : (double)NAN;
    if (rc == SH_OK) return SH_OK;
    close_watch(w);
    *out = NULL;
    return rc;
}

static const struct link_spec *link_of(struct watch *watch)
{
    watch->link_given = 1;
    return &watch->link;
}

static const struct web_source *source_of(const struct watch *watch)
{
    return &watch->source;
}

static int start(struct watch *w, struct sh_err *err)
{
    w->running = pthread_create(&w->thread, NULL, watch_observe, w) == 0;
    return w->running ? SH_OK : sh_fail(err, SH_EIO, "no thread for the observer");
}

const struct run_page watch_page = {open_watch, link_of, source_of, start, close_watch};

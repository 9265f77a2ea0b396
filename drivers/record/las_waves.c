/* SPDX-License-Identifier: MIT */
#include "drivers/record/las_waves.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/bytes.h"
#include "core/newfile.h"

enum { EXACT_KINDS = 128 };

char *las_waves_path(const char *path)
{
    char *wdp;
    return asprintf(&wdp, "%.*s.wdp", (int)strlen(path) - 4, path) >= 0 ? wdp : NULL; /* in place of .las */
}

int las_waves_check(const char *path, struct sh_err *err)
{
    char *wdp = las_waves_path(path);
    const int rc =
        wdp != NULL ? newfile_check(wdp, err) : sh_fail(err, SH_ENOMEM, "%s: no memory to write its waveforms", path);
    free(wdp);
    return rc;
}

void las_waves_head(uint8_t head[LAS_WAVES_HEAD_LEN])
{
    memset(head, 0, LAS_WAVES_HEAD_LEN);
    memcpy(head + 2, "LASF_Spec", 9);
    le_put16(head + 18, LAS_WAVES_RECORD);
    memcpy(head + 28, "waveform data packets", 21);
}

static int put_head(struct las_waves *w, struct sh_err *err)
{
    uint8_t head[LAS_WAVES_HEAD_LEN];
    las_waves_head(head);
    return outfile_write(&w->file, head, sizeof head, err);
}

int las_waves_open(struct las_waves *w, const char *path, struct sh_err *err)
{
    char *wdp = las_waves_path(path);
    int rc = SH_OK;
    if (wdp == NULL || asprintf(&w->las_part, "%s.part", path) < 0) {
        w->las_part = NULL;
        rc = sh_fail(err, SH_ENOMEM, "%s: no memory to write its waveforms", path);
    }
    if (rc == SH_OK) rc = outfile_open(&w->file, wdp, err);
    w->is_open = rc == SH_OK;
    if (rc == SH_OK) rc = put_head(w, err);
    free(wdp);
    return rc;
}

int las_waves_flush(struct las_waves *w, struct sh_err *err)
{
    return w->is_open ? outfile_flush(&w->file, err) : SH_OK;
}

/* ---- descriptors */

/* Rounds a number of samples up. Above 8 samples there are four lengths from one power of two to the next, so the 4096
 * lengths that a digitiser can have become 44. */
static uint32_t round_up(uint32_t n)
{
    uint32_t step = 1;
    while (n > 8 * step)
        step *= 2;
    return (n + step - 1) / step * step;
}

static int is_same_digitiser(const struct las_kind *a, const struct las_kind *b)
{
    return a->bits == b->bits && a->sample_ps == b->sample_ps && !(a->gain < b->gain) && !(a->gain > b->gain) &&
           !(a->offset < b->offset) && !(a->offset > b->offset);
}

/* Returns the kind with the fewest samples, but n or more; LAS_KINDS: there is none. */
static uint32_t find_kind(const struct las_waves *w, const struct las_kind *want)
{
    uint32_t best = LAS_KINDS;
    for (uint32_t i = 0; i < w->n_kinds; i++) {
        const struct las_kind *k = &w->kind[i];
        if (!is_same_digitiser(k, want) || k->n < want->n) continue;
        if (best == LAS_KINDS || k->n < w->kind[best].n) best = i;
        if (k->n == want->n) break;
    }
    return best;
}

/* Returns the bits of a sample in the file. Another sender's frame may have samples beyond the bits that it names. */
static uint32_t bits_of(const struct scanhead_wave *wave)
{
    uint8_t high = 0;
    for (size_t i = 0; i < wave->n; i++)
        high |= wave->sample[2 * i + 1];
    return wave->bits <= 8 && high == 0 ? 8 : 16;
}

/* Returns the kind of a window's packet, from 0 on; LAS_KINDS: there is no room for another one. */
static uint32_t choose_kind(struct las_waves *w, const struct scanhead_wave *wave)
{
    struct las_kind want = {.bits = bits_of(wave),
                            .n = wave->n,
                            .sample_ps = wave->sample_ps,
                            .gain = wave->count_signal,
                            .offset = -wave->baseline * wave->count_signal};
    const uint32_t best = find_kind(w, &want);
    if (best < LAS_KINDS && w->kind[best].n == wave->n) return best;
    if (w->n_kinds >= EXACT_KINDS) want.n = round_up(wave->n);
    if (best < LAS_KINDS && w->kind[best].n <= want.n) return best;
    if (w->n_kinds == LAS_KINDS) return best;
    w->kind[w->n_kinds] = want;
    return w->n_kinds++;
}

/* ---- packets */

/* Writes the samples of a window. Samples without light follow, up to the length of its kind. Returns the packet's
 * length. */
static size_t put_samples(const struct scanhead_wave *wave, const struct las_kind *kind, uint8_t *to)
{
    const uint32_t dark = (uint32_t)lrint(fmin(fmax(wave->baseline, 0), (1u << wave->bits) - 1));
    if (kind->bits == 8) {
        for (uint32_t i = 0; i < kind->n; i++)
            to[i] = i < wave->n ? wave->sample[2 * (size_t)i] : (uint8_t)dark;
        return kind->n;
    }
    memcpy(to, wave->sample, 2 * (size_t)wave->n);
    for (size_t i = wave->n; i < kind->n; i++)
        le_put16(to + 2 * i, (uint16_t)dark);
    return 2 * (size_t)kind->n;
}

int las_waves_put(struct las_waves *w, uint32_t scan, const struct scanhead_wave *wave, struct las_packet *packet,
                  int *is_new, struct sh_err *err)
{
    *is_new = 0;
    if (w->last.kind != 0 && w->scan == scan && w->pulse == wave->pulse && w->first == wave->first) {
        *packet = w->last;
        return SH_OK;
    }
    const uint32_t before = w->n_kinds, kind = choose_kind(w, wave);
    *packet = (struct las_packet){0};
    if (kind == LAS_KINDS) {
        w->n_kindless++;
        return SH_OK;
    }
    uint8_t *to = outfile_room(&w->file, 2 * (size_t)w->kind[kind].n, err);
    if (to == NULL) return SH_EIO;
    *packet = (struct las_packet){.kind = (uint8_t)(kind + 1), .at = w->file.written + w->file.len};
    packet->len = (uint32_t)put_samples(wave, &w->kind[kind], to);
    outfile_used(&w->file, packet->len);
    w->n_filled += w->kind[kind].n > wave->n;
    w->n_fill += w->kind[kind].n - wave->n;
    w->scan = scan;
    w->pulse = wave->pulse;
    w->first = wave->first;
    w->last = *packet;
    *is_new = w->n_kinds > before;
    return SH_OK;
}

/* ---- the end */

int las_waves_end(struct las_waves *w, struct sh_err *err)
{
    uint8_t len[8];
    const int rc = outfile_flush(&w->file, err);
    le_put64(len, w->file.written - LAS_WAVES_HEAD_LEN);
    return rc == SH_OK ? outfile_patch(&w->file, LAS_WAVES_LEN_AT, len, sizeof len, err) : rc;
}

int las_waves_copy(const struct las_waves *w, struct outfile *to, const struct sh_report *report, struct sh_err *err)
{
    const uint64_t len = w->file.written;
    for (uint64_t at = 0; at < len;) {
        uint8_t *room = outfile_room(to, OUTFILE_BUFFER, err);
        if (room == NULL) return SH_EIO;
        const ssize_t n = pread(w->file.fd, room, OUTFILE_BUFFER, (off_t)at);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0)
            return sh_fail(err, SH_EIO, "%s: cannot be read: %s", w->file.part,
                           n < 0 ? strerror(errno) : "it became shorter");
        outfile_used(to, (size_t)n);
        at += (uint64_t)n;
        sh_progress(report, "copying the waveforms", (double)at / (double)len);
        const int rc = outfile_check_stop(to, report, err);
        if (rc != SH_OK) return rc;
    }
    return SH_OK;
}

int las_waves_keep(struct las_waves *w, struct sh_err *err)
{
    w->is_open = 0;
    return outfile_close(&w->file, OUTFILE_KEEP_PART, err);
}

void las_waves_close(struct las_waves *w)
{
    const int is_needed = w->las_part != NULL && access(w->las_part, F_OK) == 0;
    if (w->is_open) outfile_close(&w->file, is_needed ? OUTFILE_LEAVE : OUTFILE_DROP, NULL);
    free(w->las_part);
    memset(w, 0, sizeof *w);
}

/* SPDX-License-Identifier: MIT */
#include "drivers/record/las_waves_repair.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/bytes.h"
#include "core/newfile.h"
#include "drivers/record/las_header.h"

static int is_inside(const struct las_packets *p)
{
    return p->path == NULL;
}

static int packets_open(struct las_packets *p, int is_part, struct sh_err *err)
{
    struct stat st;
    int rc = is_part ? newfile_left(p->path, &p->file.fd, err) : newfile_whole(p->path, &p->file.fd, err);
    if (rc != SH_OK) p->file.fd = -1;
    if (rc == SH_OK && fstat(p->file.fd, &st) != 0) rc = sh_fail(err, SH_EIO, "%s: cannot be read", p->path);
    if (rc == SH_OK) p->len = p->file.len = (uint64_t)st.st_size;
    return rc;
}

static int fail_head(const struct las_packets *p, const struct repair *r, struct sh_err *err)
{
    if (is_inside(p)) return repair_fail_damaged(r, p->begin, err);
    return sh_fail(err, SH_EFORMAT, "%s: holds no waveforms of scanhead; put that of %s there; both are unchanged",
                   p->path, r->path);
}

/* Returns 1 where the record ends where its own length says. */
static int is_as_long(const struct las_packets *p)
{
    return p->len >= LAS_WAVES_HEAD_LEN && p->own_len == p->len - LAS_WAVES_HEAD_LEN;
}

/* Where zeros reach into the head, that head counts as cut. */
static int find_zeros(struct las_packets *p, struct sh_err *err)
{
    static const uint64_t HEAD_TEXT_END = 49; /* zeros follow in each head */
    const int rc = repair_find_zeros(&p->file, p->begin, p->begin + p->len, &p->zeros_at, err);
    p->zeros_at -= p->begin;
    if (p->zeros_at < HEAD_TEXT_END) p->len = p->zeros_at;
    return rc;
}

/* Returns 1 where a .wdp was not completed, or a record inside a .las. Somebody may have given both .part files their
 * final names: then the header has no counts, and the record has no length. */
static int is_left_over(const struct las_packets *p, const struct repair *r, const uint8_t *header)
{
    const int is_incomplete = strcmp((const char *)header + LAS_SOFTWARE_AT, LAS_SOFTWARE_INCOMPLETE) == 0;
    return repair_is_part(&p->file) ||
           (!repair_is_part(r) && is_incomplete && le_get64(header + LAS_POINTS_AT) == 0 && p->own_len == 0);
}

/* Checks the head of the record, as far as it is there: any file may have the name X.wdp. A completed record says its
 * length. A record that is being written says 0. A power cut may leave zeros at the end of a file that was not
 * completed, also where the record is as long as it says. A file with its final name was synced before, so zeros at its
 * end are samples. */
static int read_head(struct las_packets *p, const struct repair *r, const uint8_t *header, struct sh_err *err)
{
    uint8_t is[LAS_WAVES_HEAD_LEN] = {0}, head[LAS_WAVES_HEAD_LEN];
    size_t n = p->len < sizeof is ? (size_t)p->len : sizeof is;
    int rc = repair_read(&p->file, p->begin, is, n, err);
    p->own_len = le_get64(is + LAS_WAVES_LEN_AT);
    p->zeros_at = p->len;
    p->is_left = is_left_over(p, r, header);
    if (rc == SH_OK && p->is_left) rc = find_zeros(p, err);
    if (rc != SH_OK) return rc;
    if (n > p->len) n = (size_t)p->len;
    las_waves_head(head);
    if (n > LAS_WAVES_LEN_AT) memcpy(head + LAS_WAVES_LEN_AT, is + LAS_WAVES_LEN_AT, n < 28 ? n - LAS_WAVES_LEN_AT : 8);
    if (memcmp(is, head, n) != 0) return fail_head(p, r, err);
    const int is_believed = n == sizeof is && p->own_len <= p->len - n && p->zeros_at == p->len;
    if (is_believed && (is_inside(p) || !p->is_left)) p->end = n + p->own_len;
    return SH_OK;
}

/* Cuts .part from the .las's name. Returns 1 where the name that is left is free: the file will get it. */
static int will_be_renamed(const struct repair *r, char *las)
{
    if (!repair_is_part(r)) return 0;
    las[strlen(las) - strlen(".part")] = '\0';
    return !repair_exists(las);
}

/* Returns 1 where a .part's packets may have the name X.wdp already: the header is that of a completed file, or a
 * repair was interrupted, which counts the points and renames X.wdp.part only where X.las is free. Else X.wdp is that
 * of an older recording. */
static int may_be_final(const uint8_t *header, int is_renamed)
{
    const int is_complete = strcmp((const char *)header + LAS_SOFTWARE_AT, LAS_SOFTWARE) == 0;
    return is_complete || (is_renamed && le_get64(header + LAS_POINTS_AT) != 0);
}

/* *is_part: which of both names the packets have. */
static int choose_name(const struct repair *r, const uint8_t *header, int is_renamed, const char *wdp, const char *part,
                       int *is_part, struct sh_err *err)
{
    *is_part = repair_is_part(r) && repair_exists(part);
    if (*is_part && is_renamed && repair_exists(wdp))
        return sh_fail(err, SH_ESTATE, "%s: %s exists, and is not replaced; move it away, and repeat the command", part,
                       wdp);
    if (*is_part || (repair_exists(wdp) && (!repair_is_part(r) || may_be_final(header, is_renamed)))) return SH_OK;
    const int is_with_other = repair_is_part(r) && repair_exists(wdp);
    return sh_fail(err, SH_EINPUT,
                   "%s: its waveforms are not there: put %s beside it%s%s%s; or an empty file of that name, to keep "
                   "the points alone",
                   r->path, repair_is_part(r) ? part : wdp, is_with_other ? " (rename " : "", is_with_other ? wdp : "",
                   is_with_other ? ", if it is of this recording)" : "");
}

static int find_outside(struct las_packets *p, const struct repair *r, const uint8_t *header, struct sh_err *err)
{
    char *las = strdup(r->path), *part = NULL;
    const int is_renamed = las != NULL && will_be_renamed(r, las);
    char *wdp = las != NULL ? las_waves_path(las) : NULL;
    int rc = SH_OK, is_part = 0;
    if (wdp == NULL || asprintf(&part, "%s.part", wdp) < 0) {
        part = NULL;
        rc = sh_fail(err, SH_ENOMEM, "%s: no memory to repair it", r->path);
    } else {
        rc = choose_name(r, header, is_renamed, wdp, part, &is_part, err);
    }
    p->path = is_part ? part : wdp;
    p->target = is_part && is_renamed ? wdp : NULL;
    if (p->path != wdp && p->target != wdp) free(wdp);
    if (p->path != part) free(part);
    free(las);
    p->file.path = p->path;
    if (rc == SH_OK) rc = packets_open(p, is_part, err);
    return rc == SH_OK ? read_head(p, r, header, err) : rc;
}

/* Checks where the header says that the packets are. Inside the file, their record begins where a point ends. The
 * header may also set neither bit, inside nor outside: a repair writes the header so where there are no packets. */
static int check_place(const struct repair *r, const uint8_t *header, struct sh_err *err)
{
    const uint64_t begin = le_get64(header + LAS_WAVES_AT), front = le_get32(header + 96);
    const int where = header[LAS_ENCODING_AT] & (LAS_WAVES_INSIDE | LAS_WAVES_OUTSIDE);
    const int is_at_point = begin >= front && (begin - front) % le_get16(header + 105) == 0;
    if (where == LAS_WAVES_INSIDE ? is_at_point : begin == 0 && where != (LAS_WAVES_INSIDE | LAS_WAVES_OUTSIDE))
        return SH_OK;
    return repair_fail_damaged(r, LAS_WAVES_AT, err);
}

int las_packets_find(struct las_packets *p, const struct repair *r, const uint8_t *header, struct sh_err *err)
{
    *p = (struct las_packets){
        .file = {.fd = -1, .report = r->report}, .end = LAS_WAVES_HEAD_LEN, .last = LAS_WAVES_HEAD_LEN};
    p->wave_at = header[104] == 9 ? 30 : 38;
    p->begin = le_get64(header + LAS_WAVES_AT);
    const int rc = check_place(r, header, err);
    if (rc != SH_OK) return rc;
    if ((header[LAS_ENCODING_AT] & LAS_WAVES_OUTSIDE) != 0) return find_outside(p, r, header, err);
    if (p->begin == 0) return SH_OK;
    p->file = *r;
    p->len = r->len > p->begin ? r->len - p->begin : 0;
    return read_head(p, r, header, err);
}

struct reference {
    uint64_t at, end;
};

/* Returns 1 if the point's record refers to a packet. */
static int refers(const struct las_packets *p, const uint8_t *record, struct reference *packet)
{
    const uint8_t *wave = record + p->wave_at;
    const uint64_t at = le_get64(wave + 1);
    *packet = (struct reference){at, at <= UINT64_MAX - UINT32_MAX ? at + le_get32(wave + 9) : UINT64_MAX};
    return wave[0] != 0;
}

/* Where zeros begin within a packet and go on after it, the rest of its samples is lost. */
static int is_there(const struct las_packets *p, const struct reference *packet)
{
    if (packet->end == p->len) return packet->at < p->zeros_at;
    return packet->end <= p->zeros_at;
}

void las_packets_take(struct las_packets *p, const uint8_t *record)
{
    struct reference packet;
    if (!refers(p, record, &packet)) return;
    if (!is_there(p, &packet))
        p->n_without++;
    else if (packet.end > p->last)
        p->last = packet.end;
}

/* Packets are written in the order of points, and before them. So only the last points may lack theirs. */
static int clear_points(struct las_packets *p, struct repair *r, const struct repair_rows *points, struct sh_err *err)
{
    static const uint8_t none[LAS_WAVE_LEN];
    uint8_t record[LAS_POINT_LEN_MAX];
    struct reference packet;
    uint64_t left = p->n_without;
    int rc = SH_OK;
    for (uint64_t i = points->n; i-- > 0 && left > 0 && rc == SH_OK;) {
        const uint64_t at = points->from + i * points->len;
        rc = repair_read(r, at, record, points->len, err);
        if (rc != SH_OK || !refers(p, record, &packet) || is_there(p, &packet)) continue;
        rc = repair_write(r, at + p->wave_at, none, sizeof none, err);
        left--;
    }
    return rc;
}

/* Corrects the record's own length. Returns 1 if it was wrong. */
static int set_len(struct las_packets *p, struct sh_err *err)
{
    uint8_t len[8], was[8];
    int rc = repair_read(&p->file, p->begin + LAS_WAVES_LEN_AT, was, sizeof was, err);
    le_put64(len, p->end - LAS_WAVES_HEAD_LEN);
    if (rc != SH_OK || memcmp(len, was, sizeof len) == 0) return rc;
    rc = repair_write(&p->file, p->begin + LAS_WAVES_LEN_AT, len, sizeof len, err);
    return rc == SH_OK ? 1 : rc;
}

/* A .wdp with its final name was completed, and is not cut. So a .wdp that is too short for the points is a piece, or
 * that of another recording: the points keep their references, which they need for the right one. A .las.part may lie
 * beside the .wdp of an older recording. Its own one ends with the packet of a point. */
static int check_whole(const struct las_packets *p, const struct repair *r, struct sh_err *err)
{
    const int is_short = p->n_without > 0 || p->len < LAS_WAVES_HEAD_LEN;
    const int is_other = repair_is_part(r) && (!is_as_long(p) || p->last != p->len);
    if (is_inside(p) || p->is_left || p->len == 0 || !(is_short || is_other)) return SH_OK;
    return sh_fail(err, SH_EFORMAT,
                   "%s: is %s of %s: put the right one there; or an empty file of that name, to keep the points alone; "
                   "both are unchanged",
                   p->path, is_short ? "too short for the points" : "not as long as the waveforms", r->path);
}

/* Not even the head of the record is there, so no point has a packet. */
static void leave_out_record(uint8_t *header)
{
    header[LAS_ENCODING_AT] &= (uint8_t) ~(LAS_WAVES_INSIDE | LAS_WAVES_OUTSIDE);
    memset(header + LAS_WAVES_AT, 0, LAS_POINTS_AT - LAS_WAVES_AT);
}

int las_packets_repair(struct las_packets *p, struct repair *r, const struct repair_rows *points, uint8_t *header,
                       struct sh_err *err)
{
    if (p->last > p->end) p->end = p->last;
    int rc = check_whole(p, r, err), changed = p->n_without > 0 || p->len > p->end;
    if (rc == SH_OK) rc = clear_points(p, r, points, err);
    if (rc == SH_OK && p->n_without > 0)
        sh_warn(r->report, "%s: %llu points have no waveform: it did not reach the disk", r->path,
                (unsigned long long)p->n_without);
    if (rc == SH_OK && p->len < LAS_WAVES_HEAD_LEN) {
        leave_out_record(header);
        return p->n_without > 0;
    }
    if (rc == SH_OK) rc = set_len(p, err);
    if (rc < 0) return rc;
    changed |= rc;
    if (is_inside(p)) return changed;
    header[LAS_ENCODING_AT] = (uint8_t)((header[LAS_ENCODING_AT] & ~LAS_WAVES_INSIDE) | LAS_WAVES_OUTSIDE);
    rc = repair_cut(&p->file, p->end, err);
    if (rc != SH_OK) return rc;
    if (p->target != NULL) sh_warn(r->report, "%s: its waveforms are in %s", r->path, p->target);
    return changed;
}

int las_packets_settle(struct las_packets *p, const struct repair *r, struct sh_err *err)
{
    if (p->target == NULL) return SH_OK;
    int rc = newfile_sync(r->path, r->fd, err);
    if (rc != SH_OK) return rc;
    if (p->len < LAS_WAVES_HEAD_LEN) { /* nothing refers to it any more */
        unlink(p->path);
        return SH_OK;
    }
    rc = newfile_settle_free(p->target, p->path, p->file.fd, err);
    if (rc == SH_OK) p->file.fd = -1;
    return rc;
}

void las_packets_free(struct las_packets *p)
{
    if (!is_inside(p) && p->file.fd >= 0) close(p->file.fd);
    free(p->path);
    free(p->target);
}

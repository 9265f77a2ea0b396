/* SPDX-License-Identifier: MIT */
/* The repair of .las (repair.h): LAS 1.2 and 1.4 as las.c writes them. The repair counts points, returns and bounds
 * again from the records. */
#include <string.h>

#include "core/bytes.h"
#include "drivers/record/las_header.h"
#include "drivers/record/las_waves_repair.h"
#include "drivers/record/repair.h"
#include "drivers/record/scan_count.h"

enum { RETURN_AT = 14 }; /* in a record of any format */

struct records {
    struct las_facts facts; /* counts of all records that are kept */
    size_t len;
    struct point_scans scans;
    int has_waves;
    struct las_packets packets; /* with waveforms */
};

static void take_record(void *ctx, const uint8_t *record)
{
    struct records *r = ctx;
    las_count_record(&r->facts, record);
    if (r->has_waves) las_packets_take(&r->packets, record);
    const uint8_t *time = record + las_time_at(&r->facts); /* after the station */
    point_scans_take(&r->scans, le_get16(time - 2), le_get_double(time));
}

/* Accepts only files as las.c writes them: *front_len bytes, then records of r->len. */
static int parse_header(const struct repair *repair, const uint8_t *header, size_t len, struct records *r,
                        uint32_t *front_len, struct sh_err *err)
{
    struct las_facts *f = &r->facts;
    const int is_las = len >= LAS_HEADER_12_LEN && memcmp(header, "LASF", 4) == 0 && header[24] == 1 &&
                       strncmp((const char *)header + LAS_SOFTWARE_AT, LAS_SOFTWARE, sizeof LAS_SOFTWARE - 1) == 0;
    if (!is_las) return repair_fail_none(repair, "LAS file of scanhead", err);
    const int format = header[104];
    f->minor = header[25];
    const size_t header_len = las_header_len(f);
    r->len = le_get16(header + 105);
    *front_len = le_get32(header + 96);
    const int known = f->minor == 2 ? (format == 1 || format == 3) && r->len == las_format_len(format)
                                    : f->minor == 4 && format >= 6 && format <= 10 && format != 8 &&
                                          r->len >= las_format_len(format) && r->len <= LAS_POINT_LEN_MAX;
    if (!known || len < header_len || *front_len < header_len || *front_len > LAS_FRONT_MAX || *front_len > repair->len)
        return repair_fail_none(repair, "LAS file of scanhead", err);
    r->has_waves = f->minor == 4 && format >= 9;
    for (int i = 0; i < 3; i++) {
        f->scale[i] = le_get_double(header + 131 + 8 * i);
        f->offset[i] = le_get_double(header + 155 + 8 * i);
    }
    return SH_OK;
}

static int make_whole(struct repair *repair, uint8_t *header, struct records *r, uint32_t front_len, struct sh_err *err)
{
    uint8_t renewed[LAS_HEADER_LEN];
    const size_t len = las_header_len(&r->facts);
    const struct repair_rows points = {front_len, r->facts.n_points, r->len};
    uint64_t end = front_len + points.n * points.len;
    if (r->facts.minor == 2 && r->facts.n_points > UINT32_MAX)
        return sh_fail(err, SH_EFORMAT, "%s: LAS 1.2 holds up to 4294967295 points; the file is unchanged",
                       repair->path);
    memcpy(renewed, header, len);
    las_put_counts(&r->facts, renewed);
    int rc = r->has_waves ? las_packets_repair(&r->packets, repair, &points, renewed, err) : 0;
    if (rc < 0) return rc;
    if (r->has_waves && le_get64(renewed + LAS_WAVES_AT) != 0) end = r->packets.begin + r->packets.end;
    repair->was_whole = rc == 0 && end == repair->len && memcmp(renewed, header, len) == 0;
    if (repair->was_whole) return SH_OK;
    memset(renewed + LAS_SOFTWARE_AT, 0, 32);
    strcpy((char *)renewed + LAS_SOFTWARE_AT, LAS_SOFTWARE_INCOMPLETE);
    rc = repair_cut(repair, end, err);
    return rc == SH_OK ? repair_write(repair, 0, renewed, len, err) : rc;
}

/* Returns where the points end at the latest. The header counts points once all of them are written, and then packets
 * may follow them, or zeros of a power cut. */
static uint64_t limit_points(const struct repair *repair, const uint8_t *header, const struct records *r,
                             uint32_t front_len)
{
    const uint64_t n = r->facts.minor == 2 ? le_get32(header + 107) : le_get64(header + LAS_POINTS_AT);
    const uint64_t begin = r->has_waves ? r->packets.begin : 0;
    if (begin != 0) return begin < repair->len ? begin : repair->len;
    return n != 0 && n <= (repair->len - front_len) / r->len ? front_len + n * r->len : repair->len;
}

static int las_repair_all(struct repair *repair, uint8_t header[LAS_HEADER_LEN], struct records *r, struct sh_err *err)
{
    uint32_t front_len = 0;
    const size_t len = repair->len < LAS_HEADER_LEN ? (size_t)repair->len : LAS_HEADER_LEN;
    int rc = repair_read(repair, 0, header, len, err);
    if (rc == SH_OK) rc = parse_header(repair, header, len, r, &front_len, err);
    if (rc == SH_OK && r->has_waves) rc = las_packets_find(&r->packets, repair, header, err);
    if (rc == SH_OK) {
        const uint64_t end = limit_points(repair, header, r, front_len);
        struct repair_rows rows = {front_len, (end - front_len) / r->len, r->len};
        rc = repair_leave_zeros(repair, &rows, end, RETURN_AT + 1, err); /* no record of ours has return 0 */
        if (rc == SH_OK) rc = repair_rows(repair, &rows, take_record, r, err);
    }
    if (rc == SH_OK) rc = make_whole(repair, header, r, front_len, err);
    return rc == SH_OK && r->has_waves ? las_packets_settle(&r->packets, repair, err) : rc;
}

int las_repair(struct repair *repair, struct sh_err *err)
{
    uint8_t header[LAS_HEADER_LEN];
    struct records r = {0};
    const int rc = las_repair_all(repair, header, &r, err);
    if (r.has_waves) las_packets_free(&r.packets);
    repair_say_kept(repair, "points", r.facts.n_points, r.scans.n);
    return rc;
}

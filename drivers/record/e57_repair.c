/* SPDX-License-Identifier: MIT */
/* Repair of E57 files: counts the packets of each scan up to the last whole one, and ends the file there as its
 * recorder would have done (e57_end.h). A note before each scan has what the points don't say (e57_note.h).
 *
 * A file with its own header is whole, as that is written last. A page with a wrong CRC does not count. Where correct
 * pages follow it, the file is damaged and not only cut; it is left as it is. */
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/bytes.h"
#include "core/grow.h"
#include "drivers/record/e57_end.h"
#include "drivers/record/e57_note.h"
#include "drivers/record/e57_packet.h"
#include "drivers/record/repair.h"

enum { PAGES_BETWEEN_STOPS = 1 << 14 };

struct left {
    struct repair *repair;
    struct e57_facts facts;
    size_t room;      /* of facts.scan */
    uint64_t n_pages; /* whole, from the first on */
    uint64_t end;     /* logical, of what is kept */
    uint64_t cached;  /* number of the page at hand, from 1 */
    uint8_t page[E57_PAGE];
    uint8_t packet[E57_PACKET_MAX];
};

/* 1: the page is right; 0: it is not, or not whole. */
static int read_page(struct left *l, uint64_t number, struct sh_err *err)
{
    const ssize_t n = pread(l->repair->fd, l->page, E57_PAGE, (off_t)(number * E57_PAGE));
    l->cached = number + 1;
    if (n < 0) return sh_fail(err, SH_EIO, "%s: cannot read: %s", l->repair->path, strerror(errno));
    return n == E57_PAGE && e57_page_is_right(l->page);
}

static int count_pages(struct left *l, struct sh_err *err)
{
    const uint64_t n = l->repair->len / E57_PAGE;
    int rc;
    for (uint64_t i = 0; i < n; i++) {
        if (i % PAGES_BETWEEN_STOPS == 0 && (rc = sh_check_stop(l->repair->report, err)) != SH_OK) return rc;
        if ((rc = read_page(l, i, err)) < 0) return rc;
        if (rc > 0 && i > l->n_pages)
            return sh_fail(err, SH_EFORMAT,
                           "%s: bytes %" PRIu64 " to %" PRIu64
                           " are damaged, and the file goes on after them; a repair can only cut its end",
                           l->repair->path, l->n_pages * E57_PAGE, i * E57_PAGE);
        l->n_pages += rc > 0;
    }
    return SH_OK;
}

/* Reads content. Returns 1, or 0 where not all of it is in whole pages. */
static int get(struct left *l, uint64_t logical, void *to, size_t len, struct sh_err *err)
{
    uint8_t *p = to;
    if (logical + len > l->n_pages * E57_PAGE_CONTENT) return 0;
    while (len > 0) {
        const uint64_t number = logical / E57_PAGE_CONTENT;
        size_t at = logical % E57_PAGE_CONTENT, n = E57_PAGE_CONTENT - at;
        const int rc = l->cached == number + 1 ? 1 : read_page(l, number, err);
        if (rc <= 0) return rc;
        if (n > len) n = len;
        memcpy(p, l->page + at, n);
        logical += n;
        p += n;
        len -= n;
    }
    return 1;
}

static int fail_damaged(const struct left *l, struct sh_err *err)
{
    return sh_fail(err, SH_EFORMAT,
                   "%s: at byte %" PRIu64 " there is no packet of points in the form that this file uses",
                   l->repair->path, e57_physical(l->end));
}

/* ---- scans and packets up to the last whole one */

/* Takes the scan that begins at the end of what is kept. Returns 1, or 0 where there is none, or not all of its
 * beginning. */
static int take_scan(struct left *l, struct sh_err *err)
{
    uint8_t note[E57_NOTE_LEN + E57_SECTION_HEADER_LEN];
    struct e57_facts facts = {0};
    struct e57_scan scan;
    memset(&scan, 0, sizeof scan); /* also the bytes between its members: the guid is made from all of it */
    scan.note = e57_note_place(l->end);
    scan.section = scan.note + E57_NOTE_LEN;
    const int rc = get(l, scan.note, note, sizeof note, err);
    if (rc <= 0 || e57_note_get(note, &facts, &scan) != 0) return rc < 0 ? rc : 0;
    if (scan.number != l->facts.n_scans + 1 || note[E57_NOTE_LEN] != 1) return 0;
    if (l->facts.n_scans > 0 &&
        (facts.epsg != l->facts.epsg || facts.geoid_heights != l->facts.geoid_heights ||
         facts.empty_shots != l->facts.empty_shots || facts.has_colours != l->facts.has_colours))
        return 0;
    if (!grow(&l->facts.scan, &l->room, l->facts.n_scans + 1, sizeof scan))
        return sh_fail(err, SH_ENOMEM, "%s: no memory for another scan", l->repair->path);
    facts.scan = l->facts.scan;
    facts.n_scans = l->facts.n_scans + 1;
    l->facts = facts;
    memcpy(&l->facts.scan[facts.n_scans - 1], &scan, sizeof scan);
    l->end = scan.section + E57_SECTION_HEADER_LEN;
    return 1;
}

/* Takes the packet at the end of what is kept. Returns 1, or 0 where there is none, or not all of it. */
static int take_packet(struct left *l, struct sh_err *err)
{
    struct e57_scan *scan = &l->facts.scan[l->facts.n_scans - 1];
    int rc = get(l, l->end, l->packet, E57_PACKET_HEADER_LEN, err);
    if (rc <= 0 || l->packet[0] != 1) return rc < 0 ? rc : 0;
    const size_t len = le_get16(l->packet + 2) + (size_t)1;
    if (scan->n_records % 8 != 0 || len < E57_PACKET_HEADER_LEN) return fail_damaged(l, err);
    rc = get(l, l->end, l->packet, len, err);
    if (rc <= 0) return rc;
    if (e57_packet_count(l->packet, len, &l->facts, scan) != 0) return fail_damaged(l, err);
    l->end += len;
    return 1;
}

static int take_scans(struct left *l, struct sh_err *err)
{
    int rc;
    l->end = E57_FILE_HEADER_LEN;
    while ((rc = take_scan(l, err)) > 0) {
        struct e57_scan *scan = &l->facts.scan[l->facts.n_scans - 1];
        for (uint64_t n = 0; (rc = take_packet(l, err)) > 0; n++)
            if (n % PAGES_BETWEEN_STOPS == 0 && (rc = sh_check_stop(l->repair->report, err)) != SH_OK) return rc;
        if (rc < 0) break;
        scan->section_len = l->end - scan->section;
    }
    return rc;
}

/* Checks the bytes after the part that is kept: the beginning of a packet or of a scan, zeros that fill its page, or
 * the XML section. */
static int look_behind(struct left *l, struct sh_err *err)
{
    uint8_t tail[E57_PAGE_CONTENT + E57_NOTE_LEN + E57_SECTION_HEADER_LEN] = {0}; /* more than a scan's beginning */
    const uint64_t n = l->n_pages * E57_PAGE_CONTENT - l->end, len = l->repair->len;
    const int rc = n > 0 ? get(l, l->end, tail, n < sizeof tail ? (size_t)n : sizeof tail, err) : 1;
    if (rc <= 0) return rc;
    const int is_zero = repair_is_zero(tail, sizeof tail);
    l->repair->cut_bytes = len - e57_physical(l->end);
    if (n == 0 || (is_zero && n < sizeof tail))
        l->repair->cut_bytes = len - l->n_pages * E57_PAGE;
    else if (tail[0] == '<')
        l->repair->cut_bytes = 0;
    else if (tail[0] > 1 || (tail[0] == 0 && n >= sizeof tail) ||
             (tail[0] == 0 && e57_note_place(l->end) - l->end + E57_NOTE_LEN + E57_SECTION_HEADER_LEN <= n))
        return fail_damaged(l, err);
    return SH_OK;
}

/* ---- the file's own header */

/* Returns 1 where the header is there, has the file's length, and all pages are right. */
static int is_whole(struct left *l, struct sh_err *err)
{
    uint8_t header[E57_FILE_HEADER_LEN];
    const int rc = get(l, 0, header, sizeof header, err);
    if (rc <= 0) return rc;
    return memcmp(header, "ASTM-E57", 8) == 0 && le_get64(header + 16) == l->repair->len &&
           l->n_pages * E57_PAGE == l->repair->len;
}

/* A scan without any packet gets an empty one, as its recorder would have written. */
static int put_empty_packet(struct left *l, struct e57_pages *pages, struct sh_err *err)
{
    struct e57_scan *last = &l->facts.scan[l->facts.n_scans - 1];
    if (last->section_len > E57_SECTION_HEADER_LEN) return SH_OK;
    struct e57_packet *none = calloc(1, sizeof *none);
    if (none == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to repair it", l->repair->path);
    size_t len;
    e57_packet_begin(none, &l->facts);
    const uint8_t *packet = e57_packet_make(none, &l->facts, &len);
    e57_packet_count(packet, len, &l->facts, last);
    int rc = e57_put(pages, packet, len, err);
    free(none);
    last->section_len = e57_logical(pages) - last->section;
    return rc;
}

/* The end of the file is missing still, and what was there stays: a later repair finds the same packets. */
static int fail_end(const struct outfile *file, const struct sh_err *why, struct sh_err *err)
{
    const int has_no_room = file->error == ENOSPC || file->error == EFBIG || file->error == EDQUOT;
    return sh_fail(err, why->code, "%s%s", why->text,
                   has_no_room ? "; nothing is lost: free some room and repeat the command" : "");
}

static int write_end(struct left *l, struct sh_err *err)
{
    static const uint8_t blank[E57_FILE_HEADER_LEN];
    struct repair *r = l->repair;
    struct outfile file;
    struct sh_err why = {0};
    struct e57_pages pages = {.file = &file, .n_full = l->end / E57_PAGE_CONTENT, .used = l->end % E57_PAGE_CONTENT};
    int rc = get(l, l->end - pages.used, pages.page, pages.used, err);
    if (rc <= 0) return rc < 0 ? rc : fail_damaged(l, err);
    rc = outfile_over(&file, r->fd, r->path, pages.n_full * E57_PAGE, err);
    if (rc != 0) return rc;
    rc = e57_patch(&pages, 0, blank, sizeof blank, &why); /* a file with a header counts as whole */
    if (rc == 0) rc = put_empty_packet(l, &pages, &why);
    l->facts.is_incomplete = 1;
    if (rc == 0) rc = e57_end(&pages, &l->facts, NULL, &why);
    if (rc != 0) rc = fail_end(&file, &why, err);
    outfile_leave(&file);
    return rc;
}

/* In a whole file of this program the XML section follows the last packet. Else the file is not ours,
 * or of an older release. */
static int check_ours(struct left *l, struct sh_err *err)
{
    uint8_t header[E57_FILE_HEADER_LEN];
    const int rc = get(l, 0, header, sizeof header, err);
    if (rc < 0 || (rc > 0 && le_get64(header + 24) == e57_physical(l->end))) return rc < 0 ? rc : SH_OK;
    return sh_fail(
        err, SH_EFORMAT,
        "%s: was written by another program or by an older release; its pages have correct checksums, its points are "
        "not counted; it is unchanged",
        l->repair->path);
}

static int repair_left(struct left *l, struct sh_err *err)
{
    struct repair *r = l->repair;
    int rc = count_pages(l, err);
    if (rc == SH_OK) rc = is_whole(l, err);
    if (rc < 0) return rc;
    r->was_whole = rc;
    rc = take_scans(l, err);
    if (rc < 0) return rc;
    if (l->facts.n_scans == 0 && !r->was_whole)
        return sh_fail(err, SH_EFORMAT, "%s: is not an E57 file of scanhead, or is too short: no scan begins in it",
                       r->path);
    uint64_t n = 0;
    for (uint32_t i = 0; i < l->facts.n_scans; i++)
        n += l->facts.scan[i].n_records;
    repair_say_kept(r, l->facts.empty_shots ? "points and empty shots" : "points", n, l->facts.n_scans);
    if (r->was_whole) return check_ours(l, err);
    rc = look_behind(l, err);
    return rc == SH_OK ? write_end(l, err) : rc;
}

int e57_repair(struct repair *repair, struct sh_err *err)
{
    struct left *l = calloc(1, sizeof *l);
    if (l == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to repair it", repair->path);
    l->repair = repair;
    int rc = repair_left(l, err);
    free(l->facts.scan);
    free(l);
    return rc;
}

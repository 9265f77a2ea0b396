/* SPDX-License-Identifier: MIT */
/* Each wrong command line gives one line, which is compared word for word: operands and options of all commands,
 * options that go together, and the limits of each number. */
#include "tests/unit/lines_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <cmocka.h>

#define A63 "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"

/* ---- operands, options, kinds of files */

static const struct lines_row OPERANDS[] = {
    {"one CONFIG is needed", {"plan"}},
    {"one CONFIG is needed, and 2 are given: a, b", {"plan a b"}},
    {"one CONFIG is needed, and 3 are given: a, b, ...", {"plan a b c"}},
    {"one CONFIG is needed, and 2 are given: a, --json", {"plan a -- --json"}},
    {"option --set needs a value", {"plan --set"}},
    {"--json=1: the option takes no value", {"plan x --json=1"}},
    {"unknown option --jsn, did you mean --json?", {"plan x --jsn"}},
    {"unknown option --sunshine", {"plan x --sunshine"}},
    {"-json: did you mean --json?", {"plan x -json"}},
    {"unknown option -js", {"plan x -js"}},
    {"$ is a recorded stream, and CONFIG is a configuration, a YAML file: scanhead record $ -o points.ply writes its "
     "points",
     {"plan a.shs", "plan a.pcapng"}},
    {"$ is a mesh, and CONFIG is a configuration, a YAML file: scanhead init $ writes a configuration that scans it",
     {"plan a.OBJ", "plan a.stl", "plan a.gltf", "plan a.glb", "plan a.fbx", "plan a.dae", "plan a.ifc", "plan a.tif",
      "plan a.tiff"}},
    {"$ is a mesh or a point cloud, and CONFIG is a configuration, a YAML file: scanhead init $ writes a "
     "configuration that scans a mesh",
     {"plan a.ply"}},
    {"$ is a recording, and CONFIG is a configuration, a YAML file: scanhead report CONFIG $ compares points with "
     "the scene",
     {"plan a.las"}},
    {"$ is a recording for other programs, and CONFIG is a configuration, a YAML file",
     {"plan a.laz", "plan a.e57", "plan a.ptx"}},
    {"$ is a recording for other programs, and a CONFIG, FILE.ply or FILE.las is needed",
     {"map a.laz -o m.png --perspective", "map a.e57 -o m.png --perspective"}},
    {"$ is a recorded stream, and a CONFIG, FILE.ply or FILE.las is needed: scanhead record $ -o points.ply writes its "
     "points",
     {"map a.shs -o m.png --perspective"}},
    {"scanhead: $: cannot be opened: No such file or directory; a YAML file is needed",
     {"plan a.t", "plan a.", "plan a.aaaaaaaaaaaaaaaa"}},
    {"x: it takes no arguments", {"list x"}},
    {"one CONFIG and one CLOUD are needed", {"report a"}},
    {"one CONFIG and one CLOUD are needed; c is one too many", {"report a b c", "report a.yaml b.ply c"}},
    {"--tolerance-m 2 is more than --max-m 1", {"report x y --tolerance-m 2 --max-m 1"}},
    {"--html p.pdf: the file is a page; allowed is a name that ends in .html", {"report x y --html p.pdf"}},
    {"x.yaml: with these options it takes no SOURCE", {"record --repair f x.yaml"}},
    {"-out: did you mean --output FILE, or -o FILE?", {"record x.yaml -out f"}},
    {"-outp=f: did you mean --output FILE, or -o FILE?", {"record x.yaml -outp=f"}},
    {"$ is a mesh, and SOURCE is a head, a recorded stream or a configuration: scanhead init $ writes a "
     "configuration that scans it",
     {"record a.obj -o x.ply"}},
    {"$ is a recording, and SOURCE is a head, a recorded stream or a configuration: scanhead report CONFIG $ "
     "compares points with the scene",
     {"record a.las -o x.ply"}},
    {"$ is a recording for other programs, and SOURCE is a head, a recorded stream or a configuration",
     {"record a.e57 -o x.ply"}},
    {"$ is a mesh, and CONFIG is a configuration, a YAML file: scanhead init $ writes a configuration that scans it",
     {"run a.glb"}},
    {"--ready-fd 9999: not open for writing; allowed is a descriptor that is, as with 9999>FILE",
     {"run x --journal j --ready-fd 9999"}},
    {"--journal is for a configuration, but $ is a recording of a head", {"run a.shs --journal j"}},
    {"--replay-journal is for a configuration, but $ is a recording of a head", {"run a.shs --replay-journal j"}},
    {"--surfaces is for a configuration, but $ is a recording of a head", {"run a.shs --surfaces j"}},
    {"--frames is for a configuration, but $ is a recording of a head", {"run a.shs --frames 1"}},
    {"--threads is for a configuration, but $ is a recording of a head", {"run a.shs --threads 2"}},
    {"--speed is for a recording of a head, but $ is a capture of packets", {"run a.pcap --speed 2"}},
    {"--from is for a recording of a head, but $ is a capture of packets", {"run a.pcap --from 2"}},
    {"--to is for a recording of a head, but $ is a capture of packets", {"run a.pcap --to 2"}},
    {"--clients is for a recording of a head, but $ is a capture of packets", {"run a.pcap --clients 2"}},
    {"--config is for a recording of a head, but $ is a capture of packets", {"run a.pcap --config c"}},
    {"--unknown is for a capture of packets, but $ is a recording of a head", {"run a.shs --unknown close"}},
    {"--device-port is for a capture of packets, but $ is a configuration", {"run x.yaml --device-port 80"}},
    {"--view is for a configuration or a recording, but $ is a capture of packets", {"run a.pcap --view"}},
    {"--loop is for a recording or a capture, but $ is a configuration", {"run x.yaml --loop"}},
    {"--link is for a recording or a capture, but $ is a configuration", {"run x.yaml --link pty"}},
    {"--config and --link: both give the links; allowed is one of them", {"run a.shs --config c --link pty"}},
    {"--clients: without --start a client's SCAN:STARt begins the replay; allowed with --start",
     {"run a.shs --clients 2"}},
    {"--to 2 is not after --from, which is 2; allowed is a larger number", {"run a.shs --from 2 --to 2"}},
    {"--link '': allowed are pty, tcp, ... or keys such as 'type: tcp, port: 5025'", {"run a.shs --link="}},
    {"--link 'a#b': allowed are pty, tcp, ... or keys such as 'type: tcp, port: 5025'", {"run a.shs --link a#b"}},
    {"--unknown silent: allowed are silence, error, close", {"run a.pcap --unknown silent"}},
};

/* ---- options that go together */

static const struct lines_row TOGETHER[] = {
    {"--height: allowed only with --grid", {"coverage x --height 2"}},
    {"--step-deg: allowed only with --grid or --candidates", {"coverage x --step-deg 2"}},
    {"--scans: allowed only with --grid or --candidates", {"coverage x --scans 2"}},
    {"--next needs places to compare: --grid STEP_M or --candidates FILE", {"coverage x --next 2"}},
    {"--grid and --candidates: allowed is one of them", {"coverage x --grid 1 --candidates f.csv"}},
    {"--at: allowed only with --grid", {"coverage x --at 1,2,3,4", "coverage x --candidates f.csv --at 1,2,3,4"}},
    {"--at 1,2,3: allowed is X0,Y0,X1,Y1 or X0,Y0,X1,Y1,Z0,Z1 in metres, the lower number of each pair first",
     {"coverage x --grid 1 --at 1,2,3"}},
    {"--at 3,2,1,4: allowed is X0,Y0,X1,Y1 or X0,Y0,X1,Y1,Z0,Z1 in metres, the lower number of each pair first",
     {"coverage x --grid 1 --at 3,2,1,4"}},
    {"--at 1,2,3,4,6,5: allowed is X0,Y0,X1,Y1 or X0,Y0,X1,Y1,Z0,Z1 in metres, the lower number of each pair first",
     {"coverage x --grid 1 --at 1,2,3,4,6,5"}},
    {"--by material: allowed is label", {"coverage x --by material"}},
    {"--colour: allowed with -o FILE", {"coverage x --colour seen"}},
    {"-o a.las: the file is a mesh; allowed is a name that ends in .ply, .obj, .gltf, .glb or .fbx",
     {"coverage x -o a.las"}},
    {"--colour red: allowed are seen, count, density, incidence", {"coverage x -o a.ply --colour red"}},
    {"--output: given twice; one is allowed", {"map x -o a.png -o b.png"}},
    {"-o FILE.png or -o FILE.svg is needed", {"map x"}},
    {"-o a.jpg: allowed are names that end in .png or .svg", {"map x -o a.jpg"}},
    {"$ is a point cloud; a map from above scans a CONFIG: add --perspective",
     {"map a.ply -o a.png", "map a.las -o a.png"}},
    {"options of the eye, sizes, colours and clouds need --perspective; a map from above takes -o, --pixel-m, "
     "--open-edges, --set and --quiet",
     {"map x -o a.png --eye 1,2,3"}},
    {"-o a.svg: with --perspective it is an image; allowed is a name that ends in .png",
     {"map x -o a.svg --perspective"}},
    {"--pixel-m: allowed for a map from above, not with --perspective", {"map x -o a.png --perspective --pixel-m 1"}},
    {"--open-edges: allowed for a map from above, not with --perspective",
     {"map x -o a.png --perspective --open-edges"}},
    {"$ and --cloud b.ply: one cloud is shown at a time", {"map a.ply -o a.png --perspective --cloud b.ply"}},
    {"--set: $ is not a configuration; allowed with a CONFIG", {"map a.ply -o a.png --perspective --set a=b"}},
    {"--from up: allowed are north, north-east, east, south-east, south, south-west, west, north-west, and degrees "
     "clockwise from north, -360 to 360",
     {"map x -o a.png --perspective --from up"}},
    {"--from 361: allowed are north, north-east, east, south-east, south, south-west, west, north-west, and degrees "
     "clockwise from north, -360 to 360",
     {"map x -o a.png --perspective --from 361"}},
    {"--eye 1,2: allowed are X,Y,Z in metres, each within 1e9, as in --eye 10,-5,8.5",
     {"map x -o a.png --perspective --eye 1,2"}},
    {"--eye 1,2,2e9: allowed are X,Y,Z in metres, each within 1e9, as in --eye 10,-5,8.5",
     {"map x -o a.png --perspective --eye 1,2,2e9"}},
    {"--eye 1,-2e9,2: allowed are X,Y,Z in metres, each within 1e9, as in --eye 10,-5,8.5",
     {"map x -o a.png --perspective --eye 1,-2e9,2"}},
    {"--look-at 2e9,1,2: allowed are X,Y,Z in metres, each within 1e9, as in --look-at 10,-5,8.5",
     {"map x -o a.png --perspective --look-at 2e9,1,2"}},
    {"--size 1200: allowed are WIDTHxHEIGHT in pixels, 16 to 8192 each, as in 1200x800",
     {"map x -o a.png --perspective --size 1200"}},
    {"--size 15x16: allowed are WIDTHxHEIGHT in pixels, 16 to 8192 each, as in 1200x800",
     {"map x -o a.png --perspective --size 15x16"}},
    {"--size 16.5x16: allowed are WIDTHxHEIGHT in pixels, 16 to 8192 each, as in 1200x800",
     {"map x -o a.png --perspective --size 16.5x16"}},
    {"--size 16x16.5: allowed are WIDTHxHEIGHT in pixels, 16 to 8192 each, as in 1200x800",
     {"map x -o a.png --perspective --size 16x16.5"}},
    {"--size 16x100000: allowed are WIDTHxHEIGHT in pixels, 16 to 8192 each, as in 1200x800",
     {"map x -o a.png --perspective --size 16x100000"}},
    {"--size 8192x4096: 33554432 pixels; allowed are 16777216 in all, as in 4096x4096",
     {"map x -o a.png --perspective --size 8192x4096"}},
    {"--limits 1,1: allowed are LOW,HIGH, the second larger than the first",
     {"map x -o a.png --perspective --limits 1,1"}},
    {"--limits: allowed with --colour height and range, not label",
     {"map x -o a.png --perspective --limits 1,2 --colour label"}},
    {"--limits: allowed with --colour height and range, not reflectance",
     {"map x -o a.png --perspective --limits 1,2 --colour reflectance"}},
    {"--colour hue: allowed are height, range, reflectance, label, station, rgb",
     {"map x -o a.png --perspective --colour hue"}},
    {"--eye and --from: both give the place of the eye; allowed is one of them",
     {"map x -o a.png --perspective --eye 1,2,3 --from north"}},
    {"--below 1: allowed is a height above that of --above, 1", {"map x -o a.png --perspective --below 1 --above 1"}},
    {"--client-file, --client-folder, --client-grace, --reconnect-limit, --match-mm, --allow and --junit need --client",
     {"soak x --client-file f", "soak x --client-folder f", "soak x --junit f", "soak x --reconnect-limit 1",
      "soak x --client-grace 1", "soak x --match-mm 0", "soak x --allow connects"}},
    {"--allow nothing: allowed are connects, comes-back, lets-go, asks-right, scans, keeps-up, lives, ends, points-read, "
     "points-known, points-once",
     {"soak x --allow nothing"}},
    {"several --scenario need --client", {"soak x --scenario a --scenario b"}},
    {"--truth is one file, and 2 scenarios are given; allowed is one",
     {"soak x --client c --scenario a --scenario b --truth t"}},
    {"--scenario 17: at most 16 are allowed",
     {"soak x --client c --scenario 1 --scenario 2 --scenario 3 --scenario 4 --scenario 5 --scenario 6 --scenario 7 "
      "--scenario 8 --scenario 9 --scenario 10 --scenario 11 --scenario 12 --scenario 13 --scenario 14 --scenario 15 "
      "--scenario 16 --scenario 17"}},
    {"--ascii: given twice; one is allowed", {"batch x -o d --ascii --ascii --crs utm --crs utm"}},
    {"-o DIR is needed", {"batch x"}},
    {"--json: allowed with --list", {"batch x -o d --json"}},
    {"--list and --merge: allowed is one of them", {"batch x -o d --list --merge"}},
    {"--merge checks all shards; allowed without --shard", {"batch x -o d --merge --shard 1/2"}},
    {"--sweep head.station: --stations sets the station of a job; allowed is any other key",
     {"batch x -o d --sweep head.station=1,2"}},
    {"head.frames is in --sweep, but --frames also sets it; allowed is one of them",
     {"batch x -o d --sweep head.frames=1,2 --frames 3"}},
    {"head is in --sweep, but --frames also sets head.frames; allowed is one of them",
     {"batch x -o d --sweep head={} --frames 3"}},
    {"output.crs is in --sweep, but --crs also sets it; allowed is one of them",
     {"batch x -o d --sweep output.crs=utm --crs utm"}},
    {"output.colour is in --sweep, but --colour also sets it; allowed is one of them",
     {"batch x -o d --sweep output.colour=texture --colour label"}},
    {"loop.threads is in --sweep, but --threads also sets it; allowed is one of them",
     {"batch x -o d --sweep loop.threads=1,2 --threads 1"}},
    {"loop is in --sweep, but --threads also sets loop.threads; allowed is one of them",
     {"batch x -o d --sweep loop={} --threads 1"}},
    {"a is in --set and in --sweep; allowed is one of them", {"batch x -o d --set a=1 --sweep a=1,2"}},
    {"--set stations[0].a=1 would be lost: --sweep stations.0 replaces it; allowed is one of them",
     {"batch x -o d --set stations[0].a=1 --sweep stations.0={}"}},
    {"--set stations[0].a=1 would be lost: --sweep stations replaces it; allowed is one of them",
     {"batch x -o d --set stations[0].a=1 --sweep stations={}"}},
    {"--format ply,: allowed are up to 8 endings of record, as in ply,las", {"batch x -o d --format ply,"}},
    {"--format a/b: allowed are up to 8 endings of record, as in ply,las", {"batch x -o d --format a/b"}},
    {"--format ply,las,e57,ptx,obj,gltf,glb,fbx,shs: allowed are up to 8 endings of record, as in ply,las",
     {"batch x -o d --format ply,las,e57,ptx,obj,gltf,glb,fbx,shs"}},
    {"scanhead: --stations 3-1: allowed all, or rising numbers from 1 to 4096, as in 1,3-5",
     {"batch x -o d --stations 3-1"}},
    {"scanhead: --shard 3/2: allowed I/N, from 1/N to N/N, N up to 1000000", {"batch x -o d --shard 3/2"}},
    {"--address " A63 "a: allowed are names and numbers of up to 63 characters", {"view a.txt --address " A63 "a"}},
    {"scanhead: -: a recording is shown from a file, not from standard input; allowed FILE.shs, FILE.pcapng, "
     "FILE.ply, FILE.las",
     {"view -"}},
    {"scanhead: $: this format is written, not read; allowed FILE.shs, FILE.pcapng, FILE.ply, FILE.las: `scanhead "
     "record` can write a scan to several files at once (with another -o scan.ply), and CloudCompare saves such "
     "files as .ply",
     {"view a.e57", "view a.ptx"}},
    {"scanhead: $: this is a configuration, not a recording: `scanhead run $ --view` shows its head; allowed "
     "FILE.shs, FILE.pcapng, FILE.ply, FILE.las",
     {"view a.yaml", "view a.yml"}},
    {"scanhead: $: compressed (LAZ), which is not read; allowed FILE.shs, FILE.pcapng, FILE.ply, FILE.las",
     {"view a.laz"}},
    {"scanhead: $: recordings with this ending are not shown; allowed FILE.shs, FILE.pcapng, FILE.ply, FILE.las",
     {"view a.txt", "view a.txt --address " A63}},
    {"-o x.txt: allowed is a name that ends in .yaml or .yml", {"init a.obj -o x.txt"}},
    {"--up x: allowed y, z", {"init a.obj --up x"}},
};

/* ---- limits */

static const struct lines_row LIMITS[] = {
    {"--tolerance-m x: not a number from 0 to 1000000000", {"report a b --tolerance-m=x"}},
    {"--max-m x: not a number from 1e-09 to 1000000000", {"report a b --max-m=x"}},
    {"--cell-m x: not a number from 0.001 to 1000", {"report a b --cell-m=x"}},
    {"--duration x: not a number from 0.001 to 100000000", {"run a --duration=x"}},
    {"--ready-fd x: not a whole number from 1 to 65535", {"run a --ready-fd=x"}},
    {"--speed x: not a number from 0.001 to 1000", {"run a --speed=x"}},
    {"--from x: not a number from 0 to 1000000000", {"run a --from=x"}},
    {"--to x: not a number from 0.001 to 1000000000", {"run a --to=x"}},
    {"--clients x: not a whole number from 1 to 64", {"run a --clients=x"}},
    {"--device-port x: not a whole number from 1 to 65535", {"run a --device-port=x"}},
    {"--duration x: not a number from 0.1 to 100000000", {"soak a --duration=x"}},
    {"--link x: not a whole number from 1 to 8", {"soak a --link=x"}},
    {"--reconnect-limit x: not a number from 0.01 to 3600", {"soak a --reconnect-limit=x"}},
    {"--client-grace x: not a number from 0.01 to 3600", {"soak a --client-grace=x"}},
    {"--match-mm x: not a number from 0 to 1000000", {"soak a --match-mm=x"}},
    {"--scale x: not a number from 1e-09 to 1000000000", {"init a --scale=x"}},
    {"--duration x: not a number from 0.001 to 100000000", {"record --raw a --duration=x"}},
    {"--wait x: not a number from 0 to 100000000", {"record --raw a --wait=x"}},
    {"--ready-fd x: not a whole number from 1 to 65535", {"record --raw a --ready-fd=x"}},
    {"--station x: not a whole number from 1 to 4096", {"record a --station=x"}},
    {"--frames x: not a whole number from 0 to 1000000", {"record a --frames=x"}},
    {"--duration x: not a number from 0.001 to 100000000", {"record a --duration=x"}},
    {"--wait x: not a number from 0 to 100000000", {"record a --wait=x"}},
    {"--replug x: not a number from 0 to 100000000", {"record a --replug=x"}},
    {"--long-edge x: not a number from 0 to 1000000000", {"record a --long-edge=x"}},
    {"--sparse x: not a number from 1e-06 to 1000000", {"record a --sparse=x"}},
    {"--sparse-seed x: not a whole number from 0 to 1000000000", {"record a --sparse-seed=x"}},
    {"--next x: not a whole number from 1 to 100", {"coverage a --next=x"}},
    {"--grid x: not a number from 0.001 to 1000000", {"coverage a --grid=x"}},
    {"--height x: not a number from 0 to 1000", {"coverage a --height=x"}},
    {"--step-deg x: not a number from 0.2 to 30", {"coverage a --step-deg=x"}},
    {"--scans x: not a whole number from 1 to 20", {"coverage a --scans=x"}},
    {"--pixel-m x: not a number from 0.0001 to 10000", {"map a --pixel-m=x"}},
    {"--elevation-deg x: not a number from -89 to 89", {"map a --elevation-deg=x"}},
    {"--fov-deg x: not a number from 1 to 160", {"map a --fov-deg=x"}},
    {"--below x: not a number from -1000000000 to 1000000000", {"map a --below=x"}},
    {"--above x: not a number from -1000000000 to 1000000000", {"map a --above=x"}},
    {"--point-m x: not a number from 0 to 1000", {"map a --point-m=x"}},
    {"--point-px x: not a number from 0.5 to 32", {"map a --point-px=x"}},
    {"--shade x: not a number from 0 to 4", {"map a --shade=x"}},
    {"--port x: not a whole number from 0 to 65535", {"view a --port=x"}},
    {"--ready-fd x: not a whole number from 1 to 65535", {"view a --ready-fd=x"}},
};

static void operands_and_options(void **state)
{
    (void)state;
    lines_expect(OPERANDS, sizeof OPERANDS / sizeof OPERANDS[0]);
}

static void options_that_go_together(void **state)
{
    (void)state;
    lines_expect(TOGETHER, sizeof TOGETHER / sizeof TOGETHER[0]);
}

static void numbers_have_limits(void **state)
{
    (void)state;
    lines_expect(LIMITS, sizeof LIMITS / sizeof LIMITS[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(operands_and_options),
                                       cmocka_unit_test(options_that_go_together),
                                       cmocka_unit_test(numbers_have_limits)};
    return cmocka_run_group_tests_name("command lines", tests, NULL, NULL);
}

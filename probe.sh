set -u
(python3 benchmarks/sdf.py --parts loops --swarm 10,100 --timeout 400 --loop-seconds 2 --seconds 1 --peer none --out $OUT/loops >$OUT/loops.log 2>&1) &
python3 benchmarks/sdf.py --parts swarm,scenes,edits,agreement --swarm 100,1000,10000 --seconds 1 --peer none --out $OUT/ours >/dev/null 2>$OUT/ours.log
tail -5 $OUT/ours.log
python3 - <<'PY'
import json,os
d=json.load(open(os.environ["OUT"]+"/ours/sdf.json"))
for part in ("scenes","swarm"):
    for r in d.get(part,[]):
        o=r.get("ours",{})
        for k in ("still","moving"):
            if k in o: print(r["scene"],k,"fps",o[k]["fps"],"gpu",o[k]["frame_ms"]["median"],"host",o[k]["host_ms"]["median"],o[k]["passes"])
            elif "failed" in o: print(r["scene"],o)
print(d.get("edits")); print(d.get("agreement")); print(d.get("failed"))
PY
wait
tail -20 $OUT/loops.log

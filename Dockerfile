# maniport with its extras for reports and figures: docker build -t maniport . && docker run --rm maniport
FROM python:3.12-slim

RUN apt-get update && apt-get install --yes --no-install-recommends libgomp1 && rm -rf /var/lib/apt/lists/*
WORKDIR /maniport
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY src src
RUN pip install --no-cache-dir ".[figures]" && maniport compile

WORKDIR /work
CMD ["maniport", "demo", "-o", "maniport-demo"]
